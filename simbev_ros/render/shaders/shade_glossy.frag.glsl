#version 330
// Car paint under clear coat, glass, chrome, metal and water.
#include "enums"
#include "lighting"
#include "noise"

// Slope of small waves along a light wind; from afar they average out.
vec2 ripples(vec2 place, float size) {
    vec2 swell = noise_at(place / vec2(9.0, 6.0), size / 6.0).ba - 0.5;
    vec2 along = noise_at(place.yx / vec2(1.7, 3.1) + 0.37, size / 1.7).ab - 0.5;
    vec2 small = noise_at(place / 0.8 + swell * 0.1, size / 0.8).ba - 0.5;
    return swell * 0.045 + along * 0.05 + small * 0.03;
}

void main() {
    Pixel p = this_pixel();
    Surface s = surface_of(p);
    if (p.material == MATERIAL_GLASS) s.albedo *= 0.25;
    if (p.material == MATERIAL_WATER) {
        s.normal = normalize(p.normal + vec3(ripples(p.uv, p.size), 0.0));
        s.albedo *= 0.35;  // most of what is seen is mirrored
    }
    if (p.material == MATERIAL_CAR_PAINT) {
        s.roughness = 0.12;
        s.albedo *= 0.94 + 0.06 * max(dot(p.normal, p.to_camera), 0.0);
    }
    shade(p, s);
}
