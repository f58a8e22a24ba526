#version 330
// Brightness of a lamp's point and glare, blended so that the result never exceeds white.
in vec2 v_offset;
in vec2 v_corner;
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
    float round_edge = clamp(1.5 - 1.5 * dot(v_corner, v_corner), 0.0, 1.0);  // for glare that is cut off
    vec3 color = 1.0 - exp2(-(point + glare) * round_edge * v_color);
    added = vec4(color, dot(color, LUMA));
}
