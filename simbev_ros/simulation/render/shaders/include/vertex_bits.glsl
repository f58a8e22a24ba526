// Meaning of the bits of a vertex, packed by render/geometry/vertices.py.
#include "pack"

// Moves road markings in front of the road in the depth buffer: by 3 cm at 100 m, 0.3 mm at 10 m.
const float LIFT = 6e-7;

// bits: normal; red, green, blue, material; tag, part, shading class, flags: from the lowest byte up
uint part_of(uvec3 bits) { return (bits.z >> 8u) & 0xFFu; }
bool is_tinted(uvec3 bits) { return (bits.z & 0x1000000u) != 0u; }
float lift_of(uvec3 bits) { return (bits.z & 0x2000000u) != 0u ? LIFT : 0.0; }

// sRGB color a multiplied by color b, 0xBBGGRR.
uint shaded_color(uint a, uint b) {
    uvec3 shift = uvec3(0u, 8u, 16u);
    uvec3 c = ((uvec3(a) >> shift) & 0xFFu) * ((uvec3(b) >> shift) & 0xFFu) / 255u;
    return c.x | (c.y << 8u) | (c.z << 16u);
}

// Rigid row | tag << 16 | material << 24; red, green, blue, shading class. tint: color of the actor, 0xBBGGRR.
uvec2 surface_of(uvec3 bits, uint row, uint tint) {
    uint color = bits.y & 0xFFFFFFu;
    if (is_tinted(bits)) color = shaded_color(tint, color);
    return uvec2(row | (bits.z & 0xFFu) << 16u | (bits.y & 0xFF000000u), color | (bits.z & 0xFF0000u) << 8u);
}
