// The table of rigid parts, written by render/geometry/rigid_table.py. Row 0 stands for the static world.
uniform sampler2D rigid_poses;

vec4 rigid_texel(uint row, int column) {
    return texelFetch(rigid_poses, ivec2(int(row & 127u) * 6 + column, int(row >> 7u)), 0);
}

// World point (w = 1) or direction (w = 0) of a vertex given in the actor's rest pose.
vec3 world_from_rest(uint row, vec4 rest) {
    return vec3(dot(rigid_texel(row, 0), rest), dot(rigid_texel(row, 1), rest), dot(rigid_texel(row, 2), rest));
}

// Position of a current world point in the previous frame's world.
vec3 previous_from_now(uint row, vec4 now) {
    return vec3(dot(rigid_texel(row, 3), now), dot(rigid_texel(row, 4), now), dot(rigid_texel(row, 5), now));
}
