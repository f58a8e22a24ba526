#version 330
// Labels, depth and flow at the pixels of a camera with lens distortion, from the G-buffer of an ideal camera: each pixel's
// ray takes the nearest triangle that it hits, among those that the four texels around it show.
#include "edges"
#include "flow"
#include "rigid"
#ifdef FISHEYE
#include "enums"
#include "fisheye"
#else
#include "plumb_bob"
#endif
uniform usampler2D g_surface;
uniform sampler2D g_depth;
uniform sampler2D g_slope;
uniform usampler2D g_edges;
uniform usampler2D rigid_actors;
#if ROLLING
uniform sampler2D g_motion;
uniform vec2 rows;  // time per row, in that of g_motion; the row at the time of the image
float row_time(float row) { return (row - rows.y) * rows.x; }
#endif

layout(location = 0) out uint semantic;
layout(location = 1) out uint instance;
layout(location = 2) out float depth;
layout(location = 3) out vec2 flow;

const float TOLERANCE_PX = 0.01;  // so that triangles with a common edge leave no gap
const float SMALL_PX = 1.0;

float inverse_depth(ivec2 texel, vec2 ideal) {
    return 1.0 / texelFetch(g_depth, texel, 0).x + dot(texelFetch(g_slope, texel, 0).xy, ideal - vec2(texel));
}

// Pixels from the nearest edge of the texel's triangle, positive inside.
float within(uvec4 edges, vec2 offset) {
    return min(within_edge(edges.x, offset), min(within_edge(edges.y, offset), within_edge(edges.z, offset)));
}

// The texel with the triangle that is visible at a position. Next to a small triangle there may be others of its surface
// that no texel shows, so a surface behind it is not assumed to be visible there. For labels, the same applies to long
// triangles about a texel wide, as at silhouettes; for depth, the surface behind is the better choice.
ivec2 texel_of(vec2 ideal, bool of_labels) {
    ivec2 found = ivec2(round(ideal)), first = ivec2(floor(ideal));
    uvec4 edges = texelFetch(g_edges, found, 0);
    uvec3 reach = edges.xyz & 0xFFFFu;
    uint longest = max(reach.x, max(reach.y, reach.z));
    uint second = max(min(reach.x, reach.y), min(max(reach.x, reach.y), reach.z));
    bool small = (of_labels ? second : longest) < uint(SMALL_PX / EDGE_REACH * 65535.0);
    float nearest = small ? inverse_depth(found, ideal) : -1.0;
    for (int tap = 0; tap < 4; ++tap) {
        ivec2 texel = first + ivec2(tap & 1, tap >> 1);
        edges = texelFetch(g_edges, texel, 0);
        float here = inverse_depth(texel, ideal) + uintBitsToFloat(edges.w);
        bool seen = here > nearest && within(edges, ideal - vec2(texel)) > -TOLERANCE_PX;
        nearest = seen ? here : nearest;
        found = seen ? texel : found;
    }
    return found;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
#ifdef FISHEYE
#ifndef COMPUTED
    if (!in_face(pixel)) discard;
#endif
    if (!in_circle(pixel)) {
        semantic = TAG_UNLABELED;
        instance = 0u;
        depth = uintBitsToFloat(0x7F800000u);       // +inf
        flow = vec2(uintBitsToFloat(0x7FC00000u));  // NaN
        return;
    }
#endif
    vec3 ray = lens_ray(pixel);
    vec2 ideal = ray.xy * intrinsics.xy + intrinsics.zw;
    uint bits = texelFetch(g_surface, texel_of(ideal, true), 0).x;
    uint actor = bits & 0xFFFFu;
    semantic = (bits >> 16u) & 0xFFu;
    instance = texelFetch(rigid_actors, ivec2(actor & 127u, actor >> 7u), 0).x;

    ivec2 texel = texel_of(ideal, false);
    uint row = texelFetch(g_surface, texel, 0).x & 0xFFFFu;
    float center = texelFetch(g_depth, texel, 0).x;
    bool sky = isinf(center);
    float change = inverse_depth(texel, ideal) * center;
    float ahead = sky ? center : center / clamp(change, 0.25, 4.0);  // slivers seen edge-on have arbitrary slopes
    depth = sky ? center : lens_depth(ray * ahead);

    vec4 now = world_from_optical * (sky ? vec4(ray, 0.0) : vec4(ray * ahead, 1.0));
    vec3 seen = (previous_optical_from_world * vec4(previous_from_now(row, now), now.w)).xyz;
#if ROLLING
    vec3 velocity = texelFetch(g_motion, texel, 0).xyz * (sky ? 1.0 : ahead), before = seen;
    depth += sky ? 0.0 : row_time(float(pixel.y)) * velocity.z;
    for (int step = 0; step < 3; ++step) seen = before + row_time(lens_pixel(seen).y) * velocity;
#endif
    vec2 pixel_before = lens_pixel(seen);
    if (viewport.z == 0.0) flow = vec2(0.0);
    else if (lens_sees(seen) && was_visible(pixel_before, sky ? center : lens_depth(seen))) flow = floor(gl_FragCoord.xy) - pixel_before;
    else flow = vec2(uintBitsToFloat(0x7FC00000u));  // NaN
}
