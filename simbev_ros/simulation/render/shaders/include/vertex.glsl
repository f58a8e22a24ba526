// Vertices, packed by render/geometry/vertices.py.
#include "vertex_bits"
in vec3 in_position;
in vec2 in_uv;
in uvec3 in_packed;

#ifdef LENS  // corners.geom.glsl is the next stage
#define v_normal to_normal
#define v_uv to_uv
#define v_before to_before
#define v_instance to_instance
#define v_surface to_surface
#endif
out vec3 v_normal;
out vec2 v_uv;
out vec3 v_before;
flat out uint v_instance;
flat out uvec2 v_surface;  // rigid row | tag << 16 | material << 24; red, green, blue, shading class

#ifdef LENS
flat out float to_lift;
void set_lift(float lift) { to_lift = lift * 5.0; }  // in 1 / depth: the depth buffer's nearest plane is at 0.1 m
#else
void set_lift(float lift) {}
#endif
