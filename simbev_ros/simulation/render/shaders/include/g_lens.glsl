// Additional geometry that lens distortion needs (render/lens.py).
#include "edges"
layout(location = 6) out vec2 g_slope;     // slope of 1 / depth, per pixel
layout(location = 7) out uvec4 g_edges;    // edges of the triangle; depth offset toward the camera, in 1 / depth
