#version 330
// The sky, drawn where nothing else is.
#include "g_buffer"
#ifdef LENS
#include "g_lens"
#endif

void main() {
    show_sky();
#ifdef LENS
    g_slope = vec2(0.0);
    g_edges = uvec4(uvec3(NO_EDGE), 0u);
#endif
}
