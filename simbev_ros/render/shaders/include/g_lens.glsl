// What a lens needs of the geometry beside the G-buffer (render/lens.py).
#include "edges"
layout(location = 6) out vec2 g_slope;     // of 1 / depth, per pixel
layout(location = 7) out uvec4 g_edges;    // of the triangle; how much nearer it counts, in 1 / depth
