#version 330
// The ground where an actor blocks the sky's light, on a map seen from above.
uniform float half_m;
in vec3 in_place;
in vec2 in_heading;
in vec2 in_half_size;

out vec2 v_offset;  // from the actor's center, along and across
flat out vec3 v_actor;  // half length, half width, height of the ground

const float MARGIN = 0.6;

void main() {
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    v_offset = corner * (in_half_size + MARGIN);
    v_actor = vec3(in_half_size, in_place.z);
    vec2 ground = in_place.xy + in_heading * v_offset.x + vec2(-in_heading.y, in_heading.x) * v_offset.y;
    gl_Position = vec4(ground / half_m, 0.0, 1.0);
}
