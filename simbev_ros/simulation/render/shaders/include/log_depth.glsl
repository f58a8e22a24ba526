// Logarithmic depth in two bytes: steps of 1/6000 of the depth, from 5 cm to 10 km.
vec2 packed_log_depth(float depth) {
    float level = clamp((log2(depth) + 4.33) * (65535.0 / 17.7), 0.0, 65535.0);
    float high = floor(level / 256.0);
    return vec2(high, floor(level - high * 256.0)) / 255.0;
}

float log2_depth(vec2 packed_depth) { return dot(packed_depth, vec2(65280.0, 255.0)) * (17.7 / 65535.0) - 4.33; }

// 1 for two points on one surface, almost 0 if one is much nearer: compares the difference of their logarithmic depths with
// the screen-space slope times their distance. A slope may belong to a surface or to a step between two surfaces.
float same_surface(float difference, vec2 slope, vec2 offset) {
    float off = min(abs(difference), abs(difference - dot(slope, offset)));
    return max(1.0 - 12.0 * off, 1e-3);
}
