#version 330
// Writes the G-buffer for a pixel of a triangle.
#include "g_buffer"
#include "pack"
in vec3 v_normal;
in vec2 v_uv;
flat in uvec2 v_surface;
flat in uint v_instance;
in vec3 v_before;  // position in the previous frame, optical frame
#ifdef LENS
#include "g_lens"
in vec2 v_corner;
flat in float v_lift;
#endif

const float HORIZON_M = 1e4;

void main() {
    bool is_leaf = v_surface.x >> 24u == uint(MATERIAL_FOLIAGE);  // leaves are shaded the same on both sides
    vec3 normal = gl_FrontFacing || is_leaf ? v_normal : -v_normal;
    g_surface = uvec4(v_surface.x, pack_normal(normal), floatBitsToUint(v_uv));
    // Rounding can put the center of a pixel beyond the horizon of a sliver that is seen edge-on.
    g_depth = gl_FragCoord.w > 0.0 ? 1.0 / gl_FragCoord.w : HORIZON_M;
    g_color = color_of(v_surface.y);
    semantic = (v_surface.x >> 16u) & 0xFFu;
    instance = v_instance;
    flow = flow_of(v_before, false);
#ifdef LENS
    vec3 share = vec3(v_corner, 1.0 - v_corner.x - v_corner.y) * gl_FragCoord.w;  // linear on the screen
    g_slope = vec2(dFdx(gl_FragCoord.w), dFdy(gl_FragCoord.w));
    g_edges = uvec4(pack_edge(share.x), pack_edge(share.y), pack_edge(share.z), floatBitsToUint(v_lift));
#endif
}
