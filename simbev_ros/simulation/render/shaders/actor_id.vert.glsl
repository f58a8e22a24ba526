#version 430
// Draws the triangle indices of actors (read by resolve.frag.glsl).
#include "vertex_bits"
#include "rigid"
#include "view"
in vec3 in_position;
in uvec3 in_packed;
in uint in_row;
in uint in_first;

flat out uvec2 v_id;

void main() {
    gl_Position = clip_from_world * vec4(world_from_rest(in_row + part_of(in_packed), vec4(in_position, 1.0)), 1.0);
    v_id = uvec2(in_first, in_row);
}
