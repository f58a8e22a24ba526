// Edges of a pixel's triangle relative to the pixel center: distance, up to EDGE_REACH pixels, and inward unit normal.
const float EDGE_REACH = 2.0;
const uint NO_EDGE = 0x8080FFFFu;

#ifdef LENS
// share: any quantity that is linear on the screen, 0 on the edge, positive inside.
uint pack_edge(float share) {
    vec2 slope = vec2(dFdx(share), dFdy(share));
    float steepness = max(length(slope), 1e-18);
    float distance = clamp(share / (steepness * EDGE_REACH), 0.0, 1.0);
    uvec2 normal = uvec2(round(slope / steepness * 127.0) + 128.0);
    return uint(round(distance * 65535.0)) | normal.x << 16u | normal.y << 24u;
}
#endif

// Pixels from the edge, positive inside, of a position given as an offset from the center.
float within_edge(uint bits, vec2 offset) {
    vec2 normal = (vec2((uvec2(bits) >> uvec2(16u, 24u)) & 0xFFu) - 128.0) / 127.0;
    return float(bits & 0xFFFFu) / 65535.0 * EDGE_REACH + dot(normal, offset);
}
