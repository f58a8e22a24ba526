#version 330
// How much of the sky nearby surfaces hide, at half resolution, with the depth that it belongs to.
// Scalable ambient obscurance (McGuire, Mara, Luebke 2012); the noise of 4 x 4 pixels is averaged when it is read.
#include "pixel"

out vec2 occlusion;  // openness 0..1, depth

const int TAPS = 8;
const float REACH = 1.1;      // metres
const float TURNS = 2.618;    // radians from tap to tap: the golden angle
const float BIAS = 0.002;     // of the depth, against the steps of flat surfaces
const float STRENGTH = 4.0;

vec3 optical_point(ivec2 texel) {
    float depth = min(texelFetch(g_depth, texel, 0).x, 1e4);
    return optical_ray(vec2(texel)) * depth;
}

void main() {
    ivec2 half_texel = ivec2(gl_FragCoord.xy), last = ivec2(viewport.xy) - 1;
    ivec2 texel = min(half_texel * 2, last);
    vec3 point = optical_point(texel);
    vec3 normal = transpose(mat3(world_from_optical)) * unpack_normal(texelFetch(g_surface, texel, 0).y);
    float reach_px = clamp(REACH * intrinsics.x / point.z, 2.0, viewport.y * 0.15);
    int pattern = (half_texel.x & 3) * 4 + (half_texel.y & 3);
    float angle = float((pattern * 7) & 15) * (6.2831853 / 16.0);
    float hidden = 0.0;
    for (int tap = 0; tap < TAPS; ++tap) {
        float share = (float(tap) + 0.5) / float(TAPS);
        vec2 offset = vec2(cos(angle), sin(angle)) * share * reach_px;
        vec3 towards = optical_point(clamp(texel + ivec2(offset), ivec2(0), last)) - point;
        float distance2 = dot(towards, towards);
        float falloff = max(1.0 - distance2 / (REACH * REACH), 0.0);
        hidden += max(dot(towards, normal) - BIAS * point.z, 0.0) * inversesqrt(distance2 + 0.01) * falloff;
        angle += TURNS;
    }
    occlusion = vec2(max(1.0 - STRENGTH * hidden / float(TAPS), 0.0), min(point.z, 6e4));
}
