#version 330
// Asphalt, road markings, paving slabs, concrete, grass, soil and fields; wet by rain.
#include "enums"
#include "lighting"
#include "noise"

const vec2 SLAB = vec2(0.6, 0.6);
const float JOINT = 0.006;
const float CROP_ROW = 0.75;

vec3 asphalt(vec3 albedo, vec4 coarse, vec4 middle, vec4 fine, float size) {
    float stains = (coarse.r - 0.5) * 0.30 + (middle.b - 0.5) * 0.16;
    float grain = (fine.g - 0.5) * 0.42;
    float crack = smoothstep(0.012, 0.0, abs(coarse.a - 0.5)) * smoothstep(0.45, 0.9, middle.r) * smoothstep(0.06, 0.01, size);
    return albedo * (1.0 + stains + grain) * (1.0 - 0.55 * crack);
}

vec3 marking(vec3 albedo, vec4 middle, vec4 fine) {
    float worn = smoothstep(0.62, 0.98, middle.b * 0.6 + fine.g * 0.4);
    return mix(albedo * (0.92 + 0.12 * fine.g), vec3(0.09), worn * 0.55);
}

vec3 paving(vec3 albedo, vec2 uv, vec4 coarse, vec4 fine, float size) {
    vec2 place = uv / SLAB;
    place.x += 0.5 * mod(floor(place.y), 2.0);
    vec2 to_joint = (0.5 - abs(fract(place) - 0.5)) * SLAB;
    float joint = max(line_cover(to_joint.x, JOINT, size), line_cover(to_joint.y, JOINT, size));
    float slab_seen = clamp(0.5 - size * 2.0, 0.0, 0.5) * 2.0;
    float tone = (random(floor(place)) - 0.5) * 0.16 * slab_seen;
    return albedo * (1.0 + tone + (coarse.r - 0.5) * 0.16 + (fine.g - 0.5) * 0.16) * (1.0 - 0.45 * joint);
}

vec3 grass(vec3 albedo, vec4 coarse, vec4 middle, vec4 fine) {
    float dry = smoothstep(0.45, 1.0, coarse.r * 0.6 + middle.a * 0.4);
    vec3 color = mix(albedo * vec3(0.86, 0.84, 0.8), albedo * vec3(1.16, 0.98, 0.82), dry);
    return color * (0.50 + 0.55 * fine.g + 0.35 * middle.b);
}

// Rows of plants with bare soil between them; from afar only their mean is left.
vec3 crop(vec3 albedo, vec2 uv, vec4 coarse, vec4 middle, vec4 fine, float size) {
    float across = uv.y / CROP_ROW + 0.35 * (middle.r - 0.5);
    float soil = smoothstep(0.12, 0.42, abs(fract(across) - 0.5)) * smoothstep(0.6, 0.1, size / CROP_ROW);
    vec3 color = albedo * (0.72 + 0.3 * coarse.r + 0.3 * fine.g) * (0.9 + 0.2 * middle.a);
    return mix(color, vec3(0.105, 0.078, 0.052) * (0.7 + 0.6 * fine.b), 0.7 * soil);
}

void main() {
    Pixel p = this_pixel();
    vec4 coarse = noise_at(p.uv / 37.0, p.size / 37.0);
    vec4 middle = noise_at(p.uv.yx / 5.3, p.size / 5.3);
    vec4 fine = noise_at(p.uv / 0.9, p.size / 0.9);

    Surface s = surface_of(p);
    if (p.material == MATERIAL_ASPHALT) s.albedo = asphalt(p.albedo, coarse, middle, fine, p.size);
    else if (p.material == MATERIAL_MARKING) s.albedo = marking(p.albedo, middle, fine);
    else if (p.material == MATERIAL_PAVING) s.albedo = paving(p.albedo, p.uv, coarse, fine, p.size);
    else if (p.material == MATERIAL_CONCRETE) s.albedo = p.albedo * (0.84 + 0.2 * fine.g + 0.12 * middle.r);
    else if (p.material == MATERIAL_GRASS) s.albedo = grass(p.albedo, coarse, middle, fine);
    else if (p.material == MATERIAL_CROP) s.albedo = crop(p.albedo, p.uv, coarse, middle, fine, p.size);
    else s.albedo = p.albedo * (0.6 + 0.5 * fine.g + 0.3 * middle.b);

    float level = smoothstep(0.9, 0.99, p.normal.z) * (p.material == MATERIAL_GRASS || p.material == MATERIAL_CROP ? 0.3 : 1.0);
    float puddle = level * smoothstep(1.1 - 0.6 * puddles(), 1.2 - 0.6 * puddles(), coarse.a * 0.7 + middle.r * 0.4);
    float wet = max(wetness() * level, puddle);
    s.albedo *= 1.0 - 0.5 * wet;
    s.roughness = mix(mix(s.roughness, 0.35, wet * 0.8), 0.03, puddle);
    s.specular = mix(s.specular, 0.03, wet);
    shade(p, s);
}
