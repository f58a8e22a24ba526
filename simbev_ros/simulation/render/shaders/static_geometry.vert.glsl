#version 330
#include "vertex"
#include "view"
in vec3 in_place;  // position of its tile's origin

void main() {
    vec4 place = vec4(in_place + in_position, 1.0);
    gl_Position = clip_from_world * place;
    gl_Position.z -= lift_of(in_packed) * gl_Position.w;
    v_normal = unpack_normal(in_packed.x);
    v_uv = in_uv;
    v_before = (previous_optical_from_world * place).xyz;
    v_instance = 0u;
    set_lift(lift_of(in_packed));
    v_surface = surface_of(in_packed, 0u, 0u);
}
