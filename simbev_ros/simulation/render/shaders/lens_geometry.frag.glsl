#version 330
// Labels, depth and flow at the pixels of a camera with lens distortion, from the G-buffer of an ideal camera: each pixel's
// ray takes the nearest triangle that it hits, among those that the four texels around it show.
#include "edges"
#include "flow"
#include "rigid"
uniform usampler2D g_surface;
uniform sampler2D g_depth;
uniform sampler2D g_slope;
uniform usampler2D g_edges;
uniform usampler2D rigid_actors;
uniform sampler2D lens_rays;
uniform vec4 lens_intrinsics;  // fx, fy, cx, cy, pixels
uniform vec4 lens_radial;      // k1, k2, k3; x² + y² up to which the model is valid
uniform vec2 lens_tangential;  // p1, p2

layout(location = 0) out uint semantic;
layout(location = 1) out uint instance;
layout(location = 2) out float depth;
layout(location = 3) out vec2 flow;

const float TOLERANCE_PX = 0.01;  // so that triangles with a common edge leave no gap
const float SMALL_PX = 1.0;

// Pixel of a position on the plane z = 1.
vec2 lens_pixel(vec2 place) {
    float r2 = dot(place, place);
    float radial = 1.0 + r2 * (lens_radial.x + r2 * (lens_radial.y + r2 * lens_radial.z));
    vec2 bent = place * radial + 2.0 * place.x * place.y * lens_tangential + lens_tangential.yx * (r2 + 2.0 * place * place);
    return bent * lens_intrinsics.xy + lens_intrinsics.zw;
}

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
    vec2 place = texelFetch(lens_rays, ivec2(gl_FragCoord.xy), 0).xy;
    vec2 ideal = place * intrinsics.xy + intrinsics.zw;
    uint bits = texelFetch(g_surface, texel_of(ideal, true), 0).x;
    uint actor = bits & 0xFFFFu;
    semantic = (bits >> 16u) & 0xFFu;
    instance = texelFetch(rigid_actors, ivec2(actor & 127u, actor >> 7u), 0).x;

    ivec2 texel = texel_of(ideal, false);
    uint row = texelFetch(g_surface, texel, 0).x & 0xFFFFu;
    float center = texelFetch(g_depth, texel, 0).x;
    bool sky = isinf(center);
    float change = inverse_depth(texel, ideal) * center;
    depth = sky ? center : center / clamp(change, 0.25, 4.0);  // slivers seen edge-on have arbitrary slopes

    vec4 now = world_from_optical * (sky ? vec4(place, 1.0, 0.0) : vec4(vec3(place, 1.0) * depth, 1.0));
    vec3 seen = (previous_optical_from_world * vec4(previous_from_now(row, now), now.w)).xyz;
    vec2 before = seen.xy / seen.z;
    vec2 pixel_before = lens_pixel(before);
    bool valid = seen.z > NEAREST && dot(before, before) <= lens_radial.w;
    if (viewport.z == 0.0) flow = vec2(0.0);
    else if (valid && was_visible(pixel_before, sky ? center : seen.z)) flow = floor(gl_FragCoord.xy) - pixel_before;
    else flow = vec2(uintBitsToFloat(0x7FC00000u));  // NaN
}
