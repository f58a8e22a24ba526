// Four random words: PCG4D (Jarzynski, Olano 2020).
uvec4 random_words(uvec4 bits) {
    bits = bits * 1664525u + 1013904223u;
    for (int turn = 0; turn < 2; ++turn) {
        bits.x += bits.y * bits.w;
        bits.y += bits.z * bits.x;
        bits.z += bits.x * bits.y;
        bits.w += bits.y * bits.z;
        bits ^= bits >> 16u;
    }
    return bits;
}
