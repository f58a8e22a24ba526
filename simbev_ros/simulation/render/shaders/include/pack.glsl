// Unit vectors in 32 bits: octahedral mapping, two snorm16.
uint pack_normal(vec3 normal) {
    normal /= abs(normal.x) + abs(normal.y) + abs(normal.z);
    vec2 folded = (1.0 - abs(normal.yx)) * vec2(normal.x >= 0.0 ? 1.0 : -1.0, normal.y >= 0.0 ? 1.0 : -1.0);
    ivec2 fixed_point = ivec2(round((normal.z >= 0.0 ? normal.xy : folded) * 32767.0));
    return uint(fixed_point.x & 0xFFFF) | uint(fixed_point.y) << 16u;
}

vec3 unpack_normal(uint bits) {
    vec2 square = vec2((ivec2(bits, bits >> 16u) << 16) >> 16) / 32767.0;
    vec3 normal = vec3(square, 1.0 - abs(square.x) - abs(square.y));
    float below = max(-normal.z, 0.0);
    normal.xy -= vec2(normal.x >= 0.0 ? below : -below, normal.y >= 0.0 ? below : -below);
    return normalize(normal);
}
