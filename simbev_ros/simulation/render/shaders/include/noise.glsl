// Periodic noise (render/shading/noise.py), uniform over 0..1, and patterns, all blurred to the size of the pixel.
uniform sampler2D noise;

const float NOISE_TEXELS = 256.0;

// place: repeats at every integer; pixel_size: size of one pixel, in the same unit.
vec4 noise_at(vec2 place, float pixel_size) {
    return textureLod(noise, place, log2(max(pixel_size, 1e-6) * NOISE_TEXELS));
}

// The same from the nearest mipmap level alone, at half the cost; it repeats every `period`, and several periods share
// the logarithm of the pixel's size. Pebbles, which differ most between levels, fade gradually, so that no edge is
// visible where the level changes.
vec4 texture_at(vec2 place, float period, float pixel_size) {
#if QUALITY >= 2
    return noise_at(place / period, pixel_size / period);
#else
    float blur = log2(max(pixel_size, 1e-6)) + log2(NOISE_TEXELS / period), level = max(floor(blur + 0.5), 0.0);
    vec4 found = textureLod(noise, place / period, level);
    float off = clamp(blur - level, -0.5, 0.5), fading = min(0.17 + 0.10 * level, 0.47);
    found.g = 0.5 + (found.g - 0.5) * (1.0 - off * fading * (off > 0.0 ? 1.0 : 1.5));
    return found;
#endif
}

vec4 texture_at(vec2 place, float pixel_size) { return texture_at(place, 1.0, pixel_size); }

uint hash(uvec2 cell) {
    uint bits = cell.x * 0x9E3779B1u ^ (cell.y * 0x85EBCA77u + 0x165667B1u);
    bits = (bits ^ bits >> 15u) * 0x2C1B3C6Du;
    bits = (bits ^ bits >> 12u) * 0x297A2D39u;
    return bits ^ bits >> 15u;
}

// Random number 0..1 of a cell.
float random(vec2 cell) { return float(hash(uvec2(ivec2(cell))) >> 8u) / 16777216.0; }

// Four random numbers 0..1 of a cell, in steps of 1/255.
vec4 randoms(vec2 cell) {
    uint bits = hash(uvec2(ivec2(cell)));
    return vec4((uvec4(bits) >> uvec4(0u, 8u, 16u, 24u)) & 0xFFu) / 255.0;
}

// Share of the pixel within half_width of a line at the given distance.
float line_cover(float distance, float half_width, float pixel_size) {
    float pixel = max(pixel_size, 1e-5);
    return clamp((half_width - abs(distance)) / pixel + 0.5, 0.0, 1.0) * min(1.0, 2.0 * half_width / pixel);
}

// Share of the pixel between low and high.
float span_cover(float place, float low, float high, float pixel_size) {
    float pixel = max(pixel_size, 1e-5);
    return clamp((place - low) / pixel + 0.5, 0.0, 1.0) * clamp((high - place) / pixel + 0.5, 0.0, 1.0);
}

// Share of the pixel on stripes, which are the first `share` of every unit interval. Exact at any distance.
float stripe_cover(float place, float share, float pixel_size) {
    float pixel = max(pixel_size, 1e-4);
    vec2 ends = fract(place) + vec2(-0.5, 0.5) * pixel;
    vec2 whole = floor(ends);
    vec2 covered = whole * share + min(ends - whole, vec2(share));
    return (covered.y - covered.x) / pixel;
}

// Share of the pixel on the joints of rectangular stones of a size; joint: width of the joints, in the same unit.
float joint_cover(vec2 place, vec2 stone, float joint, float pixel_size) {
    vec2 share = joint / stone, blur = pixel_size / stone;
    float across = stripe_cover(place.x / stone.x, share.x, blur.x), along = stripe_cover(place.y / stone.y, share.y, blur.y);
    return across + along - across * along;
}

// A wave from 1 at every integer to -1 between them, within 0.02 of the cosine, which is far slower.
float wave(float place) {
    float up = abs(fract(place) - 0.5) * 2.0;
    return up * up * (6.0 - 4.0 * up) - 1.0;
}

// Visible share of the differences between stones: 1 nearby, 0 where a pixel covers several stones.
float seen_apart(float stone, float pixel_size) { return clamp(1.5 - 1.5 * pixel_size / stone, 0.0, 1.0); }
