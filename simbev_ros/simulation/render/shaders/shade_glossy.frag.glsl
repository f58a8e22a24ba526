#version 330
// Car paint with clear coat, glass, chrome, metal and water.
#define SKYLINE
#include "enums"
#include "noise"
#include "lighting"
#if QUALITY >= 1
#include "cabin"
#endif

const float FLAKE = 0.0015;  // meters

// Slope of small waves in a light wind; at a distance they average out.
vec2 ripples(vec2 place, float size) {
    vec2 swell = noise_at(place / vec2(9.0, 6.0), size / 6.0).ba - 0.5;
    vec2 along = noise_at(place.yx / vec2(1.7, 3.1) + 0.37, size / 1.7).ab - 0.5;
    vec2 small = noise_at(place / 0.8 + swell * 0.1, size / 0.8).ba - 0.5;
    return swell * 0.045 + along * 0.05 + small * 0.03;
}

#if QUALITY >= 1
// Dirt of a vehicle in use: splashes up to the windows, thickest at the sills, and a film of dust. Each has its own share.
void soil(Pixel p, inout Surface s) {
    uvec4 looks = texelFetch(rigid_actors, ivec2(int(p.row & 127u), int(p.row >> 7u)), 0);
    if (looks.w == 0u) return;
    vec4 own = randoms(vec2(float(looks.x), 11.0));
    float amount = own.x * own.x * own.x, height = p.position.z - rigid_texel(p.row, 2).w;
    float patchy = texture_at(p.uv / 1.3 + own.zw, p.size / 1.3).r;
    float splashed = (1.0 - smoothstep(0.15, 0.45 + 0.75 * own.y, height - 0.35 * patchy)) * (0.35 + 0.65 * amount);
    float film = amount * (0.10 + 0.16 * patchy);
    float cover = clamp(0.62 * splashed + film, 0.0, 0.8);
    s.albedo = mix(s.albedo, vec3(0.105, 0.092, 0.075), cover);
    s.roughness = mix(s.roughness, 0.7, cover);
    s.specular *= 1.0 - 0.8 * cover;
}
#endif

void main() {
    Pixel p = this_pixel();
    Surface s = surface_of(p);
    float facing = max(dot(p.normal, p.to_camera), 0.0);
    if (p.material == MATERIAL_GLASS) {
        s.albedo *= 0.12;
        s.roughness = 0.03;
        s.specular = 0.09;
#if QUALITY >= 1
        uvec4 looks = texelFetch(rigid_actors, ivec2(int(p.row & 127u), int(p.row >> 7u)), 0);
        if (looks.w != 0u) {
            float through = 1.0 - facing;
            through = 0.9 - 0.9 * through * through * through * through * through;
            s.emission = cabin_behind(p, looks, surroundings(-p.to_camera, 0.1) * 0.6) * (through * exposure());
        }
#endif
    }
    if (p.material == MATERIAL_WATER) {
        s.normal = normalize(p.normal + vec3(ripples(p.uv, p.size), 0.0));
        s.albedo *= 0.35;  // most of the visible light is reflected
    }
    if (p.material == MATERIAL_CAR_PAINT) {
        s.roughness = 0.07;
        s.specular = 0.06;
        s.metallic = 0.0;
        // Flakes lie flat: paint is brighter when seen head-on, and glitters from nearby.
        float flakes = (random(floor(p.uv / FLAKE)) - 0.5) * 0.5 * seen_apart(FLAKE, p.size);
        float colorful = max(p.albedo.r, max(p.albedo.g, p.albedo.b)) - min(p.albedo.r, min(p.albedo.g, p.albedo.b));
        s.albedo = mix(p.albedo, vec3(dot(p.albedo, LUMA)), 0.18 * clamp(colorful * 2.0, 0.0, 1.0)) * (0.62 + 0.34 * facing + flakes * 0.6);
        // Road dust on the lower sides.
        s.roughness += 0.25 * (1.0 - smoothstep(-0.3, 0.2, p.normal.z));
#if QUALITY >= 1
        soil(p, s);
#endif
    }
    shade(p, s);
}
