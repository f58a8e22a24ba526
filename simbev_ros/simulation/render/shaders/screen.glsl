#version 330
// One triangle that covers the whole screen, at a given depth.
uniform float layer;

void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    gl_Position = vec4(corner, 2.0 * layer - 1.0, 1.0);
}
