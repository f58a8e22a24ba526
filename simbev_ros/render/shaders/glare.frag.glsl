#version 330
// Blended so that it never exceeds white.
in vec2 v_offset;
flat in vec3 v_color;
flat in vec4 v_strength;
out vec4 added;

const float LEAST = 0.015;
const vec3 LUMA = vec3(0.299, 0.587, 0.114);

void main() {
    float distance2 = dot(v_offset, v_offset);
    float point = v_strength.x * exp2(-distance2 / (v_strength.z * v_strength.z));
    float wide = 1.0 + distance2 / (v_strength.w * v_strength.w);
    float glare = max(v_strength.y * inversesqrt(wide * wide * wide) - LEAST, 0.0);
    vec3 color = 1.0 - exp2(-(point + glare) * v_color);
    added = vec4(color, dot(color, LUMA));
}
