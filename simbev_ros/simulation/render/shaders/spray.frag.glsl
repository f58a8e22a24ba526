#version 330
// A soft puff, torn at its edges, that fades where it meets surfaces.
#include "noise"
uniform sampler2D g_depth;
in vec2 v_across;
flat in vec4 v_color;
flat in vec3 v_puff;
out vec4 shaded;

void main() {
    float behind = texelFetch(g_depth, ivec2(gl_FragCoord.xy), 0).x - v_puff.x;
    float soft = clamp(behind / v_puff.y + 0.5, 0.0, 1.0), round_edge = max(1.0 - dot(v_across, v_across), 0.0);
    float torn = textureLod(noise, v_across * 0.035 + v_puff.z, 1.0).r;
    shaded = vec4(v_color.rgb, v_color.a * soft * round_edge * clamp(torn * 2.0 - 0.3 + round_edge * 0.4, 0.0, 1.0));
}
