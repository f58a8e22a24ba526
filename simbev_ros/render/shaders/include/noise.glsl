// Repeating noise (render/noise.py), evenly spread over 0..1, blurred to the size of the pixel.
uniform sampler2D noise;

const float NOISE_TEXELS = 256.0;

// place: repeats with every whole number; pixel_size: of one pixel, in the same unit.
vec4 noise_at(vec2 place, float pixel_size) {
    return textureLod(noise, place, log2(max(pixel_size, 1e-6) * NOISE_TEXELS));
}

uint hash(uvec2 cell) {
    uint bits = cell.x * 0x9E3779B1u ^ (cell.y * 0x85EBCA77u + 0x165667B1u);
    bits = (bits ^ bits >> 15u) * 0x2C1B3C6Du;
    bits = (bits ^ bits >> 12u) * 0x297A2D39u;
    return bits ^ bits >> 15u;
}

// Random number 0..1 of a cell.
float random(vec2 cell) { return float(hash(uvec2(ivec2(cell))) >> 8u) / 16777216.0; }

// Share of the pixel that lies within half_width of a line at distance.
float line_cover(float distance, float half_width, float pixel_size) {
    float pixel = max(pixel_size, 1e-5);
    return clamp((half_width - abs(distance)) / pixel + 0.5, 0.0, 1.0) * min(1.0, 2.0 * half_width / pixel);
}

// Share of the pixel that lies between low and high.
float span_cover(float place, float low, float high, float pixel_size) {
    float pixel = max(pixel_size, 1e-5);
    return clamp((place - low) / pixel + 0.5, 0.0, 1.0) * clamp((high - place) / pixel + 0.5, 0.0, 1.0);
}
