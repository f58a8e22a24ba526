#version 330
// Light of one lamp near the ground: strength · (direction to the lamp), strength, strength · height of the lamp.
in vec2 v_ground;
flat in vec3 v_lamp;
flat in vec3 v_heading;
flat in float v_strength;
out vec4 field;

const float STREET_HEIGHT = 7.5;

float street_lamp(float distance2) {
    float height2 = STREET_HEIGHT * STREET_HEIGHT;
    float cosine2 = height2 / (height2 + distance2);
    float reach = clamp(1.0 - distance2 / (30.0 * 30.0), 0.0, 1.0);
    return cosine2 * reach * reach;  // such lamps shine more to the sides than straight down
}

float headlamp(vec2 offset, vec2 heading, float kind) {
    float forward = dot(offset, heading);
    float aside = dot(offset, vec2(-heading.y, heading.x)) / (1.0 + 0.28 * max(forward, 0.0));
    float reach = clamp(1.0 - forward / (40.0 * kind), 0.0, 1.0);
    return smoothstep(-0.2, 2.5, forward) * exp(-aside * aside) * reach * reach * 1.6 / (1.0 + 0.045 * forward);
}

void main() {
    vec2 offset = v_ground - v_lamp.xy;
    bool street = v_heading.z == 0.0;
    float strength = v_strength * (street ? street_lamp(dot(offset, offset)) : headlamp(offset, v_heading.xy, v_heading.z));
    float height = street ? STREET_HEIGHT : 0.0;
    vec2 direction = -offset * inversesqrt(dot(offset, offset) + height * height + 1e-4);
    field = strength * vec4(direction, 1.0, v_lamp.z);
}
