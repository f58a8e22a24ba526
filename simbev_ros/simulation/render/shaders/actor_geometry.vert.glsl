#version 330
#include "vertex"
#include "rigid"
#include "view"
uniform usampler2D rigid_actors;
#include "tint"
in uint in_row;

void main() {
    uint row = in_row + part_of(in_packed);
    vec4 now = vec4(world_from_rest(row, vec4(in_position, 1.0)), 1.0);
    gl_Position = clip_from_world * now;
    v_before = (previous_optical_from_world * vec4(previous_from_now(row, now), 1.0)).xyz;
    v_normal = world_from_rest(row, vec4(unpack_normal(in_packed.x), 0.0));
    v_uv = in_uv;
    uvec4 actor = texelFetch(rigid_actors, ivec2(row & 127u, row >> 7u), 0);
    v_instance = actor.x;
    set_lift(0.0);
    v_surface = surface_of(in_packed, row, tint_of(in_packed, row, actor.z));
}
