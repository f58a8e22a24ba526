#version 330
// The fastest and the slowest motion in each tile of the G-buffer, or among a tile and those around it.
#define SMOOTH_STEPS 1
#include "moving"
layout(location = 0) out vec4 fast;  // motion as in motion.frag; its speed, pixels
layout(location = 1) out vec4 slow;  // motion; maximum difference between speeds of adjacent texels, pixels

void main() {
    ivec2 tile = ivec2(gl_FragCoord.xy);
    float slow_speed = 1e9;
    fast = vec4(0.0, 0.0, 0.0, -1.0);
    slow = vec4(0.0);
#if AROUND
    ivec2 last = textureSize(fastest, 0) - 1;
    vec2 place = place_of(tile * TILE + TILE / 2);
    for (int k = 0; k < 9; ++k) {
        ivec2 other = clamp(tile + ivec2(k % 3, k / 3) - 1, ivec2(0), last);
        vec4 fast_there = texelFetch(fastest, other, 0), slow_there = texelFetch(slowest, other, 0);
        float speed = length(speed_of(slow_there.xyz, place));
        fast = fast_there.w > fast.w ? fast_there : fast;
        slow = vec4(speed < slow_speed ? slow_there.xyz : slow.xyz, max(slow.w, slow_there.w));
        slow_speed = min(speed, slow_speed);
    }
#else
    ivec2 last = textureSize(g_motion, 0) - 1;
    for (int y = 0; y < TILE; ++y) {
        vec2 before = vec2(0.0);
        for (int x = y & 1; x < TILE; x += 2) {
            ivec2 texel = min(tile * TILE + ivec2(x, y), last);
            vec3 motion = texelFetch(g_motion, texel, 0).xyz;
            vec2 flow = speed_of(motion, place_of(texel));
            float speed = length(flow), jump = x < 2 ? 0.0 : distance(flow, before);
            fast = speed > fast.w ? vec4(motion, speed) : fast;
            slow = vec4(speed < slow_speed ? motion : slow.xyz, max(slow.w, jump));
            slow_speed = min(speed, slow_speed);
            before = flow;
        }
    }
#endif
}
