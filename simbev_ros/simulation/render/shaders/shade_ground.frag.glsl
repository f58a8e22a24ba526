#version 330
// Asphalt, road markings, paving slabs, concrete, grass, soil and fields; wet by rain.
#ifndef WET
#define WET 0
#endif
#if !WET
#define MATT
#endif
#include "enums"
#include "lighting"
#include "noise"
#include "snow"
#if WET
#include "water"
#endif

const float CROP_ROW = 0.75;
const float SWATH = 2.4;  // width of two passes of a mower
const vec3 OLD_ASPHALT = vec3(0.075, 0.074, 0.072);
const float MARKING_WEAR = 0.2;  // mean share of worn paint

// Share of noise of a wavelength that remains when it is blurred to the size of the pixel.
float left(float wavelength, float size) { return clamp(1.5 - 2.0 * size / wavelength, 0.0, 1.0); }

// Four random numbers of the quarter, a square of a town in which roads, and sidewalks, are alike.
vec4 quarter(vec2 uv, float salt) { return randoms(floor(uv / 173.0) + salt); }

vec3 asphalt(vec3 albedo, vec4 coarse, vec4 middle, vec4 fine, float size) {
    float stains = (coarse.r - 0.5) * 0.34 + (middle.b - 0.5) * 0.22;
    float stones = (fine.g - 0.5) * 0.75 + (fine.b - 0.5) * 0.25;
    float crack = line_cover(middle.r - 0.5, 0.006, size * 0.9) * smoothstep(0.60, 0.80, coarse.a) * left(0.1, size);
    float sealed = line_cover(coarse.r - 0.62, 0.0042, size * 0.14) * smoothstep(0.40, 0.50, coarse.b) * left(0.6, size);
    float oil = smoothstep(0.80, 0.97, middle.a) * smoothstep(0.35, 0.8, coarse.b) * left(1.0, size);
    vec3 color = albedo * (0.88 + 0.88 * (stains + stones)) * vec3(1.02, 1.0, 0.97);
    return color * (1.0 - 0.6 * crack) * (1.0 - 0.55 * sealed) * (1.0 - 0.4 * oil);
}

vec3 marking(vec3 albedo, vec4 coarse, vec4 middle, vec4 fine, float size) {
    float tired = 0.40 * middle.b + 0.34 * fine.g + 0.26 * coarse.a;  // flakes off stone by stone, most where there is most traffic
    float worn = mix(MARKING_WEAR, smoothstep(0.52, 0.66, tired), left(0.06, size));
    float dust = 0.42 + 0.18 * coarse.r + 0.12 * fine.b + 0.10 * middle.r;
    vec3 paint = mix(albedo, vec3(dot(albedo, LUMA)), 0.15) * vec3(1.0, 0.985, 0.95);
    return mix(paint * dust, OLD_ASPHALT, 0.8 * worn);
}

// Slabs in bond, small stones or asphalt, from light to as dark as roads, gray or red, depending on the quarter.
vec3 paving(vec3 albedo, vec2 uv, vec4 coarse, vec4 middle, vec4 fine, float size) {
    vec4 kind = quarter(uv, 64.0);
    albedo = mix(albedo, vec3(dot(albedo, LUMA)), 0.35) * mix(0.24, 1.0, kind.y) * (kind.z < 0.2 ? vec3(1.10, 0.96, 0.87) : vec3(1.0));
    if (kind.x < 0.2) return asphalt(albedo * 0.5, coarse, middle, fine, size);
    vec2 slab = kind.x < 0.7 ? vec2(0.6, 0.4) : vec2(0.3, 0.3);
    vec2 place = uv;
    place.x += 0.5 * slab.x * mod(floor(uv.y / slab.y), 2.0);
    vec4 own = randoms(floor(place / slab));
    float tone = (own.x - 0.5) * 0.20 * seen_apart(slab.y, size);
    vec3 color = albedo * 0.70 * (1.0 + tone + (coarse.r - 0.5) * 0.22 + (middle.b - 0.5) * 0.16 + (fine.g - 0.5) * 0.30);
    float dirt = smoothstep(0.60, 0.95, 0.55 * coarse.a + 0.45 * middle.r);
    color *= (1.0 - 0.22 * dirt) * (1.0 + (own.y - 0.5) * vec3(0.07, 0.0, -0.06) * seen_apart(slab.y, size));
    float joint = joint_cover(place, slab, 0.009, size);
    return mix(color, vec3(0.062, 0.058, 0.048), joint * (0.45 + 0.5 * middle.a));
}

// Curb stones and cast walls, with one joint per meter.
vec3 concrete(vec3 albedo, vec2 uv, vec3 normal, vec4 coarse, vec4 middle, vec4 fine, float size) {
    vec2 joints = vec2(stripe_cover(uv.x, 0.009, size), normal.z > 0.5 ? stripe_cover(uv.y, 0.009, size) : 0.0);
    float stone = 0.12 * (random(floor(uv)) - 0.5) * seen_apart(1.0, size);
    float tone = 0.76 + stone + 0.26 * (fine.g - 0.5) + 0.20 * (middle.r - 0.5) + 0.16 * (coarse.r - 0.5);
    float grime = smoothstep(0.50, 0.95, middle.b) * (normal.z > 0.5 ? 0.22 : 0.35);
    return albedo * tone * (1.0 - grime) * (1.0 - 0.55 * max(joints.x, joints.y));
}

vec3 grass(vec3 albedo, vec2 uv, vec4 coarse, vec4 middle, vec4 fine, float size) {
    float dry = smoothstep(0.45, 1.0, coarse.r * 0.5 + middle.a * 0.5);
    vec3 color = mix(albedo * vec3(0.56, 0.57, 0.54), albedo * vec3(0.84, 0.70, 0.66), 0.75 * dry);
    float mown = (stripe_cover(uv.y / SWATH, 0.5, size / SWATH) - 0.5) * 0.14 * (1.0 - smoothstep(0.35, 0.75, middle.r));
    float blades = 0.75 * (fine.g - 0.5) + 0.65 * (fine.b - 0.5) + 0.35 * (middle.b - 0.5);
    vec3 straw = vec3(1.0 + 0.5 * max(fine.a - 0.7, 0.0), 1.0, 1.0 - 0.4 * max(fine.a - 0.7, 0.0));
    return color * max(1.0 + blades + mown, 0.15) * straw;
}

// Rows of plants with bare soil between them; at a distance only their mean remains.
vec3 crop(vec3 albedo, vec2 uv, vec4 coarse, vec4 middle, vec4 fine, float size) {
    float across = uv.y / CROP_ROW + 0.35 * (middle.r - 0.5);
    float soil = mix(0.36, smoothstep(0.12, 0.42, abs(fract(across) - 0.5)), (1.0 - smoothstep(0.1, 0.6, size / CROP_ROW)));
    vec3 color = albedo * (0.45 + 0.3 * coarse.r + 0.55 * fine.g) * (0.9 + 0.2 * middle.a);
    return mix(color, vec3(0.105, 0.078, 0.052) * (0.6 + 0.8 * fine.g), 0.7 * soil);
}

// Crumbs and pebbles.
vec3 soil(vec3 albedo, vec4 coarse, vec4 middle, vec4 fine, float size) {
    float pebble = smoothstep(0.86, 0.95, fine.g) * left(0.03, size);
    vec3 color = albedo * (1.0 + 0.85 * (fine.g - 0.5) + 0.4 * (middle.b - 0.5) + 0.25 * (coarse.r - 0.5)) * 0.85;
    return mix(color, vec3(0.24, 0.22, 0.19), 0.5 * pebble);
}

// Leaves or flowers on cells of ground, more of them where the noise is high; at a distance only their mean remains.
vec3 strew(vec3 albedo, vec2 uv, float cell, float share, vec3 tone, vec3 other, float size) {
    vec4 own = randoms(floor(uv / cell) + 4096.0);
    vec2 off = fract(uv / cell) - 0.5 - (own.xy - 0.5) * 0.5;
    float spot = (1.0 - smoothstep(0.10, 0.20, dot(off, off) + 0.5 * off.x * off.y)) * step(own.z + 0.004, share);
    float cover = mix(0.45 * share, spot, seen_apart(cell, size));
    return mix(albedo, mix(tone, other, own.w) * (0.6 + 0.6 * own.x), cover);
}

// Share of a material's snow, leaves and flowers: traffic clears roads.
vec3 strewn_on(uint material) {
    if (material == MATERIAL_ASPHALT || material == MATERIAL_MARKING) return vec3(0.46, 0.10, 0.0);
    if (material == MATERIAL_GRASS) return vec3(1.0, 0.6, 0.16);
    if (material == MATERIAL_SOIL) return vec3(1.0, 0.9, 0.0);
    return material == MATERIAL_CROP ? vec3(1.0, 0.0, 0.0) : vec3(0.9, 0.32, 0.0);
}

void main() {
    Pixel p = this_pixel();
    float size = p.size;
    vec4 middle = texture_at(p.uv.yx, 5.3, size);
#if QUALITY >= 1
    vec4 coarse = texture_at(p.uv, 37.0, size);
#else
    vec4 coarse = middle.abgr;
#endif
    vec4 fine = texture_at(p.uv, 0.75, size);

    Surface s = surface_of(p);
    if (p.material == MATERIAL_ASPHALT) s.albedo = asphalt(p.albedo * mix(0.65, 2.2, quarter(p.uv, 17.0).x), coarse, middle, fine, size);
    else if (p.material == MATERIAL_MARKING) s.albedo = marking(p.albedo, coarse, middle, fine, size);
    else if (p.material == MATERIAL_PAVING) s.albedo = paving(p.albedo, p.uv, coarse, middle, fine, size);
    else if (p.material == MATERIAL_CONCRETE) s.albedo = concrete(p.albedo, p.uv, p.normal, coarse, middle, fine, size);
    else if (p.material == MATERIAL_GRASS) s.albedo = grass(p.albedo, p.uv, coarse, middle, fine, size);
    else if (p.material == MATERIAL_CROP) s.albedo = crop(p.albedo, p.uv, coarse, middle, fine, size);
    else s.albedo = soil(p.albedo, coarse, middle, fine, size);

    if (strewn.x + strewn.y + strewn.z > 0.0) {
        vec3 amount = strewn_on(p.material) * wet_share(tunnel_at(p.position, p.normal));
        float patch_ = smoothstep(0.25, 0.75, 0.6 * coarse.b + 0.4 * middle.a);
        float leaves = leaf_litter() * amount.y * (0.3 + 1.1 * patch_);
        if (leaf_litter() > 0.0) s.albedo = strew(s.albedo, p.uv, 0.10, leaves, vec3(0.15, 0.068, 0.02), vec3(0.27, 0.16, 0.04), size);
        if (flowers() > 0.0) s.albedo = strew(s.albedo, p.uv, 0.08, flowers() * amount.z * patch_, vec3(0.75, 0.72, 0.66), vec3(0.72, 0.5, 0.02), size);
        s.albedo = snowed(s.albedo, p.normal, 0.5 * coarse.r + 0.35 * middle.g + 0.15 * fine.g, amount.x);
    }
#if WET
    Water water = water_on(p.material, p.normal, coarse.a * 0.7 + middle.r * 0.4, wet_share(tunnel_at(p.position, p.normal)));
    s.albedo *= 1.0 - 0.5 * water.film;
    s.roughness = roughness_under(water, s.roughness);
    s.specular = mix(s.specular, 0.03, water.film);
    s.normal = normalize(s.normal + vec3(ring_slope(p.uv, size) * water.film, 0.0));
#endif
    shade(p, s);
}
