#version 330
#include "enums"
// G-buffer of the pixels that no surface covers: the sky.
layout(location = 0) out uvec4 g_surface;
layout(location = 1) out float g_depth;
layout(location = 2) out vec4 g_color;

void main() {
    g_surface = uvec4(TAG_SKY << 16u, 0u, 0u, 0u);
    g_depth = uintBitsToFloat(0x7F800000u);  // +inf
    g_color = vec4(0.0);                     // shading class 0
}
