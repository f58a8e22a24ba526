#version 330
// Light of a lamp at the ceiling: falls with the distance, seen from the road below.
in vec2 v_offset;
out vec4 field;

const float SHARPNESS = 4.0;

void main() {
    float distance2 = dot(v_offset, v_offset);
    float fading = max(1.0 - distance2, 0.0);
    field = vec4(0.0, 0.0, 0.55 * fading / (1.0 + SHARPNESS * distance2), 0.0);
}
