#version 330
// The surroundings of a lamp in a tunnel, on a map seen from above.
uniform float half_m;
uniform vec3 center;
uniform float reach;
in vec3 in_lamp;
out vec2 v_offset;  // from the lamp, as a share of its reach

void main() {
    v_offset = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    gl_Position = vec4((in_lamp.xy - center.xy + v_offset * reach) / half_m, 0.0, 1.0);
}
