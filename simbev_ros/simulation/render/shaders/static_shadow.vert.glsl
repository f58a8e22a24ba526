#version 330
uniform mat4 clip_from_shadow;
in vec3 in_place;  // position of its tile's origin
in vec3 in_position;

void main() { gl_Position = clip_from_shadow * vec4(in_place + in_position, 1.0); }
