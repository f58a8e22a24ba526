// The table of rigid parts as render/rigid_table.py writes it. Row 0 is all that does not move.
uniform sampler2D rigid_poses;

vec4 rigid_texel(uint row, int column) {
    return texelFetch(rigid_poses, ivec2(int(row & 127u) * 6 + column, int(row >> 7u)), 0);
}

// Point of the world (w = 1) or direction (w = 0), of a vertex in the actor's rest pose.
vec3 world_from_rest(uint row, vec4 rest) {
    return vec3(dot(rigid_texel(row, 0), rest), dot(rigid_texel(row, 1), rest), dot(rigid_texel(row, 2), rest));
}

// Where a point of the world now was in the world of the previous frame.
vec3 previous_from_now(uint row, vec4 now) {
    return vec3(dot(rigid_texel(row, 3), now), dot(rigid_texel(row, 4), now), dot(rigid_texel(row, 5), now));
}
