#version 430
// Writes the index of the triangle that a pixel shows, and of its owner.
flat in uvec2 v_id;
layout(location = 0) out uvec2 triangle_id;

void main() { triangle_id = v_id + uvec2(gl_PrimitiveID, 0); }
