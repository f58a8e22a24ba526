#version 330
in vec2 v_tube;
out vec4 field;

void main() { field = vec4(v_tube, 0.0, 1.0); }
