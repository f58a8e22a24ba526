// Vertices as render/vertices.py packs them.
#include "pack"
in vec3 in_position;
in vec2 in_uv;
in uvec3 in_packed;  // normal; red, green, blue, material; tag, part, shading class, flags: from the lowest byte up

#ifdef LENS  // corners.geom.glsl is next
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

// Brings road markings before the road in the depth buffer: by 3 cm at 100 m, 0.3 mm at 10 m.
const float LIFT = 6e-7;

#ifdef LENS
flat out float to_lift;
void set_lift(float lift) { to_lift = lift * 5.0; }  // in 1 / depth: the depth buffer's nearest plane is at 0.1 m
#else
void set_lift(float lift) {}
#endif

uint part_of(uvec3 bits) { return (bits.z >> 8u) & 0xFFu; }
bool is_tinted(uvec3 bits) { return (bits.z & 0x1000000u) != 0u; }
float lift_of(uvec3 bits) { return (bits.z & 0x2000000u) != 0u ? LIFT : 0.0; }

uvec2 surface_of(uvec3 bits, uint row, uint color) {
    return uvec2(row | (bits.z & 0xFFu) << 16u | (bits.y & 0xFF000000u), color | (bits.z & 0xFF0000u) << 8u);
}
