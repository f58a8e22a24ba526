#version 330
// The ground that a lamp reaches, on a map seen from above: a trapezoid from behind to ahead of it.
uniform float half_m;
in vec3 in_lamp;
in vec2 in_heading;
in vec4 in_extent;     // start, end, along the heading; half width at the start and at the end
in vec4 in_light;
in float in_half_width;  // for a lamp that is a line across the heading

out vec2 v_offset;  // from the lamp, along its heading and to the left
flat out vec2 v_heading;
flat out vec4 v_light;
flat out vec3 v_size;  // height of the lamp in the world, half width, reach

void main() {
    float to = float(gl_VertexID & 1), side = float(gl_VertexID >> 1) * 2.0 - 1.0;
    v_offset = vec2(mix(in_extent.x, in_extent.y, to), side * mix(in_extent.z, in_extent.w, to));
    v_heading = in_heading;
    v_light = in_light;
    v_size = vec3(in_lamp.z, in_half_width, in_extent.y);
    vec2 ground = in_lamp.xy + in_heading * v_offset.x + vec2(-in_heading.y, in_heading.x) * v_offset.y;
    gl_Position = vec4(ground / half_m, 0.0, 1.0);
}
