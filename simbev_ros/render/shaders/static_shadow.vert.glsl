#version 330
uniform mat4 clip_from_shadow;
uniform vec3 tile;  // its origin in the shadows' world
in vec3 in_position;

void main() { gl_Position = clip_from_shadow * vec4(tile + in_position, 1.0); }
