#version 330
uniform mat4 clip_from_tile;
in vec3 in_position;

void main() { gl_Position = clip_from_tile * vec4(in_position, 1.0); }
