#version 330
// The G-buffer: everything that labels and light need to know of the nearest surface.
#include "enums"
#include "pack"
#include "flow"
in vec3 v_normal;
in vec2 v_uv;
flat in uvec2 v_surface;
flat in uint v_instance;
in vec3 v_before;  // in the previous frame, optical

layout(location = 0) out uvec4 g_surface;  // rigid row | tag << 16 | material << 24; normal; u; v
layout(location = 1) out float g_depth;    // metres along the optical axis
layout(location = 2) out vec4 g_color;     // sRGB albedo, 2^shading class
layout(location = 3) out uint semantic;
layout(location = 4) out uint instance;
layout(location = 5) out vec2 flow;
#ifdef LENS
#include "edges"
in vec2 v_corner;
flat in float v_lift;
layout(location = 6) out vec2 g_slope;     // of 1 / depth, per pixel
layout(location = 7) out uvec4 g_edges;    // of the triangle; how much nearer it counts, in 1 / depth
#endif

void main() {
    bool is_leaf = v_surface.x >> 24u == uint(MATERIAL_FOLIAGE);  // leaves shade alike on both sides
    vec3 normal = gl_FrontFacing || is_leaf ? v_normal : -v_normal;
    g_surface = uvec4(v_surface.x, pack_normal(normal), floatBitsToUint(v_uv));
    g_depth = 1.0 / gl_FragCoord.w;
    g_color = vec4((uvec4(v_surface.y) >> uvec4(0u, 8u, 16u, 24u)) & 0xFFu) / 255.0;
    semantic = (v_surface.x >> 16u) & 0xFFu;
    instance = v_instance;
    flow = flow_of(v_before);
#ifdef LENS
    vec3 share = vec3(v_corner, 1.0 - v_corner.x - v_corner.y) * gl_FragCoord.w;  // linear on the screen
    g_slope = vec2(dFdx(gl_FragCoord.w), dFdy(gl_FragCoord.w));
    g_edges = uvec4(pack_edge(share.x), pack_edge(share.y), pack_edge(share.z), floatBitsToUint(v_lift));
#endif
}
