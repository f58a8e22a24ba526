#version 330
#include "enums"
#include "flow"
// G-buffer of the pixels that no surface covers: the sky.
layout(location = 0) out uvec4 g_surface;
layout(location = 1) out float g_depth;
layout(location = 2) out vec4 g_color;
layout(location = 3) out uint semantic;
layout(location = 4) out uint instance;
layout(location = 5) out vec2 flow;
#ifdef LENS
#include "edges"
layout(location = 6) out vec2 g_slope;
layout(location = 7) out uvec4 g_edges;
#endif

void main() {
    g_surface = uvec4(TAG_SKY << 16u, 0u, 0u, 0u);
    g_depth = uintBitsToFloat(0x7F800000u);  // +inf
    g_color = vec4(vec3(0.0), 1.0 / 255.0);  // shading class 0
    semantic = TAG_SKY;
    instance = 0u;
#ifdef LENS
    g_slope = vec2(0.0);
    g_edges = uvec4(uvec3(NO_EDGE), 0u);
#endif
    vec3 ray = optical_ray(floor(gl_FragCoord.xy));
    flow = flow_of(mat3(previous_optical_from_world) * mat3(world_from_optical) * ray);
}
