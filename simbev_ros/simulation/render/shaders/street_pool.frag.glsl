#version 330
// Light of a street lamp near the ground: strength · (direction to the lamp), strength, strength · height of the lamp.
in vec2 v_offset;
flat in vec2 v_heading;
flat in vec4 v_light;
flat in vec3 v_size;
out vec4 field;

const float HEIGHT = 7.5;

void main() {
    float distance2 = dot(v_offset, v_offset);
    float height2 = HEIGHT * HEIGHT;
    float reach = clamp(1.0 - distance2 / (v_size.z * v_size.z), 0.0, 1.0);
    float cosine2 = height2 / (height2 + distance2);
    // Street lamps shine more to the sides than straight down.
    float strength = v_light.x * reach * reach * cosine2 * sqrt(cosine2) * 1.15;
    vec2 offset = v_heading * v_offset.x + vec2(-v_heading.y, v_heading.x) * v_offset.y;
    field = strength * vec4(-offset * inversesqrt(distance2 + height2), 1.0, v_size.x);
}
