// The tint of a vertex: the actor's color, or a further tint, from the second half of its line of the table of rigid parts.
uint tint_of(uvec3 bits, uint row, uint color) {
    uint slot = tint_slot(bits);
    return slot < 2u ? color : texelFetch(rigid_actors, ivec2(128u + (row & 127u), row >> 7u), 0)[slot - 2u];
}
