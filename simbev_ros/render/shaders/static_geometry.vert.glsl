#version 330
#include "vertex"
uniform mat4 clip_from_tile;

void main() {
    gl_Position = clip_from_tile * vec4(in_position, 1.0);
    gl_Position.z -= lift_of(in_packed) * gl_Position.w;
    v_normal = unpack_normal(in_packed.x);
    v_uv = in_uv;
    v_surface = surface_of(in_packed, 0u, in_packed.y & 0xFFFFFFu);
}
