#version 330
#include "rigid"
uniform mat4 clip_from_shadow;
in vec3 in_position;
in uvec3 in_packed;
in uint in_row;

void main() {
    uint row = in_row + ((in_packed.z >> 8u) & 0xFFu);
    gl_Position = clip_from_shadow * vec4(world_from_rest(row, vec4(in_position, 1.0)), 1.0);
}
