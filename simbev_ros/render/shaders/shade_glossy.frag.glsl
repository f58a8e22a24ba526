#version 330
// Car paint under clear coat, glass, chrome, metal and water.
#include "enums"
#include "lighting"
#include "noise"


void main() {
    Pixel p = this_pixel();
    Surface s = surface_of(p);
    if (p.material == MATERIAL_GLASS) s.albedo *= 0.25;
    if (p.material == MATERIAL_WATER) {
        vec4 waves = noise_at(p.uv / 4.0, p.size / 4.0);
        s.normal = normalize(p.normal + vec3(waves.bg - 0.5, 0.0) * 0.08);
    }
    if (p.material == MATERIAL_CAR_PAINT) {
        s.roughness = 0.12;
        s.albedo *= 0.94 + 0.06 * max(dot(p.normal, p.to_camera), 0.0);
    }
    shade(p, s);
}
