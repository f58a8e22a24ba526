#version 330
// Matte surfaces: brick, plaster, roofs, wood, rubber, plastic, bark, cloth, leather, skin and hair.
#define MATT
#include "enums"
#include "lighting"
#include "masonry"
#include "noise"
#include "snow"

const vec2 TILE = vec2(0.24, 0.32);
const float SEAM = 1.0;  // distance between the seams of flat roofs

bool is_cloth(uint material) {
    return material == MATERIAL_CLOTH || material == MATERIAL_CLOTH_TINTED || material == MATERIAL_CLOTH_SECOND;
}

// Length and height of one period of the noise, meters: stretched along the grain.
vec2 grain_of(uint material) {
    if (material == MATERIAL_BARK) return vec2(0.8, 2.0);
    if (material == MATERIAL_WOOD) return vec2(0.6, 6.0);
    if (material == MATERIAL_HAIR) return vec2(0.15, 1.2);
    if (is_cloth(material)) return vec2(0.9, 1.8);
    if (material == MATERIAL_PLASTER) return vec2(2.0, 5.0);
    return vec2(4.0);
}

// Courses of tiles on slopes, sheets with seams on flat roofs.
vec3 roofing(vec3 albedo, vec2 uv, vec4 grain, bool level, float size) {
    vec3 aged = mix(albedo, vec3(dot(albedo, GRAY)), 0.25) * (0.70 + 0.30 * grain.r + 0.24 * grain.g);
    vec2 place = uv / TILE;
    place.x += 0.5 * mod(floor(place.y), 2.0);
    vec4 own = randoms(floor(place) + 4096.0);
    float apart = seen_apart(TILE.x, size);
    float lap = stripe_cover(place.y, 0.14, size / TILE.y), side = stripe_cover(place.x, 0.08, size / TILE.x);
    vec3 tiles = aged * (1.0 + (own.x - 0.5) * 0.34 * apart) * (1.0 - 0.5 * lap) * (1.0 - 0.35 * side);
    float moss = smoothstep(0.66, 0.95, 0.6 * grain.r + 0.4 * grain.b);
    vec3 sheets = aged * (1.0 - 0.25 * stripe_cover(uv.x / SEAM, 0.04, size / SEAM));
    return level ? sheets : mix(tiles, vec3(0.07, 0.075, 0.045), 0.35 * moss);
}

// 0 toward x .. 2 away from it.
float facing_share(vec3 normal) { return 1.0 - normal.x / (abs(normal.x) + abs(normal.y) + 1e-4); }

void main() {
    Pixel p = this_pixel();
    vec2 period = grain_of(p.material);
    // The sides of a trunk differ by the direction that they face: u is about the same all around.
    float around = p.normal.y < 0.0 ? 4.0 - facing_share(p.normal) : facing_share(p.normal);
    vec2 place = p.uv + vec2(p.material == MATERIAL_BARK ? 0.4 * around : 0.0, 0.0);
    vec4 grain = texture_at(place / period, p.size * inversesqrt(period.x * period.y));
    Surface s = surface_of(p);
    s.albedo *= 0.90 + 0.10 * grain.r + 0.10 * (grain.g - 0.5);
    if (p.material == MATERIAL_BRICK) {
        s.albedo = brickwork(s.albedo, p.uv, grain.a, p.size);
    } else if (p.material == MATERIAL_ROOF) {
        s.albedo = roofing(p.albedo, p.uv, grain, p.normal.z > 0.97, p.size);
    } else if (p.material == MATERIAL_PLASTER) {
        s.albedo *= (1.0 - 0.30 * smoothstep(0.5, 1.0, grain.b)) * (0.90 + 0.10 * grain.g);
    } else if (p.material == MATERIAL_BARK) {
        s.albedo *= 0.45 + 0.7 * grain.b + 0.4 * grain.g;
        s.normal = normalize(p.normal + (grain.bag - 0.5) * 0.7);
    } else if (p.material == MATERIAL_WOOD) {
        s.albedo *= 0.70 + 0.35 * grain.b + 0.25 * grain.g;
    } else if (is_cloth(p.material)) {  // folds
        s.albedo *= 0.86 + 0.28 * grain.b;
        s.normal = normalize(p.normal + (grain.bar - 0.5) * 0.55);
    } else if (p.material == MATERIAL_HAIR) {
        s.albedo *= 0.6 + 0.8 * grain.g;
        s.normal = normalize(p.normal + (grain.gba - 0.5) * 0.3);
    } else if (p.material == MATERIAL_SKIN) {
        s.translucency = 0.15;
    } else if (p.material == MATERIAL_RUBBER) {
        s.albedo = mix(s.albedo, vec3(0.05, 0.047, 0.042), 0.3 + 0.4 * grain.a);  // road dust
    }
    if (snow() > 0.0 && p.row == 0u) s.albedo = snowed(s.albedo, p.normal, 0.6 * grain.r + 0.4 * grain.b, p.material == MATERIAL_TWIG ? 0.5 : 0.95);
    s.albedo *= 1.0 - 0.25 * wetness() * max(p.normal.z, 0.0);
    shade(p, s);
}
