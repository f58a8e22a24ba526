#version 330
// Optical flow: all motion is rigid, so depth and the rigid part of a pixel tell where its surface point was.
#include "view"
#include "rigid"
uniform usampler2D g_surface;
uniform sampler2D g_depth;

out vec2 flow;

const float NEAREST_M = 1e-3;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec2 pixel = vec2(texel);
    float depth = texelFetch(g_depth, texel, 0).x;
    vec3 ray = optical_ray(pixel);
    bool sky = isinf(depth);
    vec4 now = world_from_optical * (sky ? vec4(ray, 0.0) : vec4(ray * depth, 1.0));
    vec3 before = previous_from_now(texelFetch(g_surface, texel, 0).x & 0xFFFFu, now);
    vec3 seen = (previous_optical_from_world * vec4(before, now.w)).xyz;
    vec2 pixel_before = seen.xy / seen.z * intrinsics.xy + intrinsics.zw;
    if (viewport.z == 0.0) flow = vec2(0.0);
    else if (seen.z < NEAREST_M) flow = vec2(uintBitsToFloat(0x7FC00000u));  // NaN
    else flow = pixel - pixel_before;
}
