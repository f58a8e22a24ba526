#version 330
// Reflective sheeting, and lamps: those of vehicles by their light bits, traffic signals by their state, street lamps by
// the time of day, unless they are broken.
#include "enums"
#include "lighting"
#include "noise"
#include "number"
uniform usampler2D signal_states;
uniform sampler2D street_lamps;  // intensity of each lamp when it is dark, 128 per line

const float SHEETING_GAIN = 30.0;
const vec2 FLUTE = vec2(0.026, 0.043);  // size of flutes in lenses and in the reflectors behind them, meters

// Brightness of retroreflective sheeting: it returns the light of headlamps to them, and to a camera near them.
float retroreflected(vec3 position, vec3 to_camera) {
    vec4 field = texture(beam_field, map_place(coarse_place(position)));
    float towards = dot(field.xy, normalize(to_camera.xy)) / max(field.z, 1e-4);
    return min(SHEETING_GAIN * field.z * smoothstep(0.95, 0.99, towards), 0.9);
}

float on(uint bits, uint mask) { return (bits & mask) != 0u ? 1.0 : 0.0; }

vec3 vehicle_lamp(uint material, vec3 albedo, uint bits) {
    if (material == MATERIAL_LAMP_LOW_BEAM) return vec3(1.0, 0.97, 0.9) * max(on(bits, LIGHT_LOW_BEAM) * 1.6, on(bits, LIGHT_HIGH_BEAM) * 2.6);
    if (material == MATERIAL_LAMP_TAIL) return vec3(1.0, 0.03, 0.015) * max(on(bits, LIGHT_LOW_BEAM) * 0.28, on(bits, LIGHT_BRAKE) * 1.7);
    if (material == MATERIAL_LAMP_TURN_LEFT) return vec3(1.0, 0.24, 0.01) * on(bits, LIGHT_TURN_LEFT) * 1.6;
    if (material == MATERIAL_LAMP_TURN_RIGHT) return vec3(1.0, 0.24, 0.01) * on(bits, LIGHT_TURN_RIGHT) * 1.6;
    if (material == MATERIAL_LAMP_REVERSE) return vec3(1.0, 0.98, 0.94) * on(bits, LIGHT_REVERSE) * 1.4;
    return normalize(albedo + 1e-3) * on(bits, LIGHT_EMERGENCY) * 2.4;
}

vec3 signal_lamp(uint material, uint state) {
    if (material == MATERIAL_SIGNAL_RED) return vec3(1.0, 0.04, 0.02) * (state == STATE_RED || state == STATE_RED_YELLOW ? 1.8 : 0.0);
    if (material == MATERIAL_SIGNAL_YELLOW) return vec3(1.0, 0.28, 0.01) * (state == STATE_YELLOW || state == STATE_RED_YELLOW ? 1.8 : 0.0);
    return vec3(0.05, 1.0, 0.45) * (state == STATE_GREEN ? 1.5 : 0.0);
}

void main() {
    Pixel p = this_pixel();
    Surface s = surface_of(p);
    uint bits = texelFetch(rigid_actors, ivec2(p.row & 127u, p.row >> 7u), 0).y;
    if (p.material == MATERIAL_PLATE) {
        s.albedo = numbered(s.albedo, p.uv, p.row, p.size);
        if (lamps_lit() > 0.0) s.emission = s.albedo * retroreflected(p.position, p.to_camera);
    } else if (p.material <= MATERIAL_LAMP_EMERGENCY) {
        vec2 flute = fract(p.uv / FLUTE) - 0.5;
        float apart = seen_apart(FLUTE.x, p.size), bulge = 1.0 - 4.0 * dot(flute, flute) * apart;
        vec3 along = normalize(cross(vec3(0.0, 0.0, 1.0), p.normal) + vec3(1e-4, 0.0, 0.0));
        s.normal = normalize(p.normal + (along * flute.x + vec3(0.0, 0.0, flute.y)) * 0.9 * apart);
        s.specular = 0.12;
        s.emission = vehicle_lamp(p.material, p.albedo, bits) * mix(0.9, 0.6 + 0.85 * max(bulge, 0.0), apart);
        s.albedo *= mix(0.6, 0.4 + 0.55 * max(bulge, 0.0), apart);
    } else if (p.material <= MATERIAL_SIGNAL_GREEN) {
        s.emission = signal_lamp(p.material, texelFetch(signal_states, ivec2(int(round(p.uv.x)), 0), 0).x);
        s.albedo *= 0.35;
    } else if (p.material == MATERIAL_TUNNEL_LAMP) {
        s.emission = vec3(1.0, 0.90, 0.72) * 2.0;
    } else {
        int lamp = int(round(p.uv.x));
        s.emission = vec3(1.0, 0.86, 0.62) * lamps_lit() * 2.2 * texelFetch(street_lamps, ivec2(lamp & 127, lamp >> 7), 0).x;
    }
    shade(p, s);
}
