#version 330
// Labels, depth and flow at the pixels of a camera whose lens distorts, from the G-buffer of an ideal one: what its
// texel nearest to the pixel's ray shows, with the depth at which the ray meets the plane of that texel's triangle.
#include "view"
#include "rigid"
uniform usampler2D g_surface;
uniform sampler2D g_depth;
uniform sampler2D g_slope;
uniform usampler2D rigid_actors;
uniform sampler2D lens_rays;
uniform vec4 lens_intrinsics;  // fx, fy, cx, cy, pixels
uniform vec4 lens_radial;      // k1, k2, k3; x² + y² up to which they hold
uniform vec2 lens_tangential;  // p1, p2

layout(location = 0) out uint semantic;
layout(location = 1) out uint instance;
layout(location = 2) out float depth;
layout(location = 3) out vec2 flow;

const float NEAREST_M = 1e-3;

// Pixel of a place on the plane z = 1.
vec2 lens_pixel(vec2 place) {
    float r2 = dot(place, place);
    float radial = 1.0 + r2 * (lens_radial.x + r2 * (lens_radial.y + r2 * lens_radial.z));
    vec2 bent = place * radial + 2.0 * place.x * place.y * lens_tangential + lens_tangential.yx * (r2 + 2.0 * place * place);
    return bent * lens_intrinsics.xy + lens_intrinsics.zw;
}

void main() {
    vec2 place = texelFetch(lens_rays, ivec2(gl_FragCoord.xy), 0).xy;
    vec2 ideal = place * intrinsics.xy + intrinsics.zw;
    vec2 nearest = round(ideal);
    ivec2 texel = ivec2(nearest);
    uint bits = texelFetch(g_surface, texel, 0).x;
    uint row = bits & 0xFFFFu;
    semantic = (bits >> 16u) & 0xFFu;
    instance = texelFetch(rigid_actors, ivec2(row & 127u, row >> 7u), 0).x;

    float center = texelFetch(g_depth, texel, 0).x;
    bool sky = isinf(center);
    float change = dot(texelFetch(g_slope, texel, 0).xy, ideal - nearest) * center;
    depth = sky ? center : center / clamp(1.0 + change, 0.25, 4.0);  // slivers seen edge-on have any slope

    vec4 now = world_from_optical * (sky ? vec4(place, 1.0, 0.0) : vec4(vec3(place, 1.0) * depth, 1.0));
    vec3 seen = (previous_optical_from_world * vec4(previous_from_now(row, now), now.w)).xyz;
    vec2 before = seen.xy / seen.z;
    bool unseen = seen.z < NEAREST_M || dot(before, before) > lens_radial.w;
    if (viewport.z == 0.0) flow = vec2(0.0);
    else if (unseen) flow = vec2(uintBitsToFloat(0x7FC00000u));  // NaN
    else flow = floor(gl_FragCoord.xy) - lens_pixel(before);
}
