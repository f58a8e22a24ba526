#version 330
// Motion of the surface at each texel of the G-buffer in the time between both poses.
#include "rigid"
#include "view"
uniform usampler2D g_surface;
uniform sampler2D g_depth;
out vec4 motion;  // displacement in the optical frame as a share of the depth; 1 / depth

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float depth = texelFetch(g_depth, texel, 0).x;
    vec3 ray = optical_ray(vec2(texel));
    bool sky = isinf(depth);
    vec4 now = world_from_optical * (sky ? vec4(ray, 0.0) : vec4(ray * depth, 1.0));
    uint row = texelFetch(g_surface, texel, 0).x & 0xFFFFu;
    vec3 then = previous_from_now(row, now);
    vec3 before = (previous_optical_from_world * vec4(then, now.w)).xyz;
    vec3 moved = ray - (sky ? before : before / depth);
    motion = vec4(moved, sky ? 0.0 : 1.0 / depth);
}
