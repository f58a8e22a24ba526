// Meaning of the bits of a vertex, packed by render/geometry/vertices.py.
#include "pack"

// Moves road markings in front of the road in the depth buffer: by 3 cm at 100 m, 0.3 mm at 10 m.
const float LIFT = 6e-7;

// bits: normal; red, green, blue, material; tag, part, shading class, flags: from the lowest byte up
uint part_of(uvec3 bits) { return (bits.z >> 8u) & 0xFFu; }
uint tint_slot(uvec3 bits) { return (bits.z >> 24u) & 7u; }  // 0: not tinted, 1: by the actor's color, 2 to 5: its further tints
float lift_of(uvec3 bits) { return (bits.z & 0x8000000u) != 0u ? LIFT : 0.0; }

// sRGB color a multiplied by color b, 0xBBGGRR.
uint shaded_color(uint a, uint b) {
    uvec3 shift = uvec3(0u, 8u, 16u);
    uvec3 c = ((uvec3(a) >> shift) & 0xFFu) * ((uvec3(b) >> shift) & 0xFFu) / 255u;
    return c.x | (c.y << 8u) | (c.z << 16u);
}

// Rigid row | tag << 16 | material << 24; red, green, blue, shading class. tint: 0xBBGGRR, where there is a slot.
uvec2 surface_of(uvec3 bits, uint row, uint tint) {
    uint color = bits.y & 0xFFFFFFu;
    if (tint_slot(bits) != 0u) color = shaded_color(tint, color);
    return uvec2(row | (bits.z & 0xFFu) << 16u | (bits.y & 0xFF000000u), color | (bits.z & 0xFF0000u) << 8u);
}
