// The G-buffer: everything that labels and lighting need to know about the nearest surface.
#include "enums"
#include "flow"
layout(location = 0) out uvec4 g_surface;  // rigid row | tag << 16 | material << 24; normal; u; v
layout(location = 1) out float g_depth;    // meters along the optical axis
layout(location = 2) out vec4 g_color;     // sRGB albedo, 2^shading class
layout(location = 3) out uint semantic;
layout(location = 4) out uint instance;
layout(location = 5) out vec2 flow;

vec4 color_of(uint bytes) { return vec4((uvec4(bytes) >> uvec4(0u, 8u, 16u, 24u)) & 0xFFu) / 255.0; }

// A pixel that no surface covers.
void show_sky() {
    g_surface = uvec4(TAG_SKY << 16u, 0u, 0u, 0u);
    g_depth = uintBitsToFloat(0x7F800000u);  // +inf
    g_color = vec4(vec3(0.0), 1.0 / 255.0);  // shading class 0
    semantic = TAG_SKY;
    instance = 0u;
    vec3 ray = optical_ray(floor(gl_FragCoord.xy));
    flow = flow_of(mat3(previous_optical_from_world) * mat3(world_from_optical) * ray, true);
}
