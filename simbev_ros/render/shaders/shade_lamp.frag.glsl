#version 330
// Lamps of vehicles by their light bits, traffic signals by their state, street lamps by the time of day.
#include "lighting"
uniform usampler2D rigid_actors;
uniform usampler2D signal_states;

const uint LOW_BEAM = 1u, BRAKE = 2u, TURN_LEFT = 4u, TURN_RIGHT = 8u, REVERSE = 16u, EMERGENCY = 32u, HIGH_BEAM = 64u;
const uint RED = 1u, YELLOW = 2u, GREEN = 3u, RED_YELLOW = 4u;

float on(uint bits, uint mask) { return (bits & mask) != 0u ? 1.0 : 0.0; }

vec3 vehicle_lamp(uint material, vec3 albedo, uint bits) {
    if (material == 28u) return vec3(1.0, 0.97, 0.9) * max(on(bits, LOW_BEAM) * 1.6, on(bits, HIGH_BEAM) * 2.6);
    if (material == 29u) return vec3(1.0, 0.03, 0.015) * max(on(bits, LOW_BEAM) * 0.28, on(bits, BRAKE) * 1.7);
    if (material == 30u) return vec3(1.0, 0.42, 0.02) * on(bits, TURN_LEFT) * 1.6;
    if (material == 31u) return vec3(1.0, 0.42, 0.02) * on(bits, TURN_RIGHT) * 1.6;
    if (material == 32u) return vec3(1.0, 0.98, 0.94) * on(bits, REVERSE) * 1.4;
    return normalize(albedo + 1e-3) * on(bits, EMERGENCY) * 2.4;
}

vec3 signal_lamp(uint material, uint state) {
    if (material == 34u) return vec3(1.0, 0.04, 0.02) * (state == RED || state == RED_YELLOW ? 1.8 : 0.0);
    if (material == 35u) return vec3(1.0, 0.55, 0.03) * (state == YELLOW || state == RED_YELLOW ? 1.8 : 0.0);
    return vec3(0.05, 1.0, 0.45) * (state == GREEN ? 1.5 : 0.0);
}

void main() {
    Pixel p = this_pixel();
    Surface s = surface_of(p);
    uint bits = texelFetch(rigid_actors, ivec2(p.row & 127u, p.row >> 7u), 0).y;
    if (p.material <= 33u) {
        s.emission = vehicle_lamp(p.material, p.albedo, bits);
    } else if (p.material <= 36u) {
        s.emission = signal_lamp(p.material, texelFetch(signal_states, ivec2(int(round(p.uv.x)), 0), 0).x);
        s.albedo *= 0.35;
    } else {
        s.emission = vec3(1.0, 0.86, 0.62) * lamps_lit() * 2.2;
    }
    shade(p, s);
}
