#version 430
// Draws the indices of static triangles (read by resolve.frag.glsl).
#include "vertex_bits"
#include "view"
in vec3 in_position;
in uvec3 in_packed;
in vec3 in_place;  // position of its tile's origin
in uint in_tile;
in uint in_first;

flat out uvec2 v_id;

void main() {
    gl_Position = clip_from_world * vec4(in_place + in_position, 1.0);
    gl_Position.z -= lift_of(in_packed) * gl_Position.w;
    v_id = uvec2(in_first, 0x80000000u | in_tile);
}
