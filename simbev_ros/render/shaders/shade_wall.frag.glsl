#version 330
// Walls with windows, curtain walls and shop fronts. uv: along the wall, up; 3 m a bay, 3 m a storey.
#include "enums"
#include "lighting"
#include "noise"

uniform vec3 window_colors[8];  // sRGB
uniform int window_color_count;
uniform float window_share;  // of the windows of rooms, lit; 0: all lights of buildings are off
uniform float window_seed;

const float BAY = 3.0;
const vec2 BRICK_SIZE = vec2(0.25, 0.085);
const float BOARD = 0.18;
const float SHEET = 0.30;

struct Opening {  // in one bay, metres
    vec2 low, high;
    float frame;    // width of the frame around the glass
    float mullion;  // half width of the upright in the middle
    float recess;   // depth of the glass behind the wall
};

// form: 0..1, the same all over a building.
Opening opening_of(uint material, float form) {
    if (material == MATERIAL_OFFICE_GLASS) return Opening(vec2(0.05, 0.75), vec2(2.95, 2.95), 0.035, 0.035, 0.03);
    if (material == MATERIAL_SHOPFRONT) return Opening(vec2(0.15, 0.35), vec2(2.85, 2.45), 0.06, 0.03, 0.12);
    if (material == MATERIAL_CONCRETE_FACADE) return Opening(vec2(0.25, 0.90), vec2(2.75, 2.45), 0.06, 0.03, 0.12);
    if (material == MATERIAL_METAL_FACADE) return Opening(vec2(-0.10, 1.20), vec2(3.10, 2.30), 0.05, 0.03, 0.06);
    if (material == MATERIAL_TIMBER_FACADE) return Opening(vec2(1.00, 0.85), vec2(2.00, 2.25), 0.08, 0.025, 0.05);
    if (form < 0.3) return Opening(vec2(1.00, 0.70), vec2(2.00, 2.45), 0.07, 0.03, 0.16);
    if (form > 0.8) return Opening(vec2(0.60, 0.95), vec2(2.40, 2.35), 0.07, 0.03, 0.14);
    return Opening(vec2(0.85, 0.85), vec2(2.15, 2.40), 0.07, 0.03, 0.16);
}

// The wall's own pattern: bricks, boards, panels or corrugated sheets.
vec3 clad(vec3 wall, uint material, vec2 uv, float size) {
    if (material == MATERIAL_BRICK_FACADE) {
        vec2 place = uv / BRICK_SIZE;
        place.x += 0.5 * mod(floor(place.y), 2.0);
        vec2 to_joint = (0.5 - abs(fract(place) - 0.5)) * BRICK_SIZE;
        float joint = max(line_cover(to_joint.x, 0.006, size), line_cover(to_joint.y, 0.006, size));
        float tone = (random(floor(place) + 8192.0) - 0.5) * 0.4 * clamp(1.0 - size * 12.0, 0.0, 1.0);
        return mix(wall * (1.0 + tone), vec3(0.42, 0.39, 0.35), joint * 0.7);
    }
    if (material == MATERIAL_TIMBER_FACADE) {
        float board = fract(uv.y / BOARD);
        float shade = smoothstep(0.30, 0.0, board) * smoothstep(0.6, 0.15, size / BOARD);
        float tone = (random(vec2(floor(uv.y / BOARD) + 8192.0, 3.0)) - 0.5) * 0.12;
        return wall * (1.0 + tone - 0.4 * shade);
    }
    if (material == MATERIAL_CONCRETE_FACADE) {
        vec2 to_joint = (0.5 - abs(fract(uv / BAY) - 0.5)) * BAY;
        float joint = max(line_cover(to_joint.x, 0.02, size), line_cover(to_joint.y, 0.02, size));
        float tone = (random(floor(uv / BAY) + 8192.0) - 0.5) * 0.10;
        return wall * (1.0 + tone) * (1.0 - 0.5 * joint);
    }
    if (material == MATERIAL_METAL_FACADE) {
        float seen = smoothstep(0.5, 0.12, size / SHEET);
        return wall * (1.0 + 0.22 * cos(6.2832 * uv.x / SHEET) * seen);
    }
    return wall;
}

float within(vec2 place, vec2 low, vec2 high, float size) {
    return span_cover(place.x, low.x, high.x, size) * span_cover(place.y, low.y, high.y, size);
}

// What stands in a shop window: goods of many colours below, the dim back of the shop above.
vec3 goods_on_display(vec2 uv, float height, float size) {
    vec2 cell = floor(uv / vec2(0.23, 0.34));
    vec3 color = 0.15 + 0.35 * random(cell + 99.0) + 0.3 * vec3(random(cell), random(cell + 333.0), random(cell + 777.0));
    float seen = clamp(1.2 - size * 4.0, 0.0, 1.0);
    float stocked = step(height, 0.7 + 0.9 * random(vec2(cell.x, 5.0))) * seen;
    float back = 0.10 + 0.16 * height / 2.5 + 0.12 * noise_at(uv / 6.0, size / 6.0).r;
    return mix(vec3(0.9, 0.82, 0.7) * back, color * 0.5, stocked * 0.4);
}

// Shops' fascias: dark green, navy, burgundy, charcoal or cream.
vec3 sign_tone(float pick) {
    vec3 dark = pick < 0.25 ? vec3(0.025, 0.09, 0.06) : pick < 0.5 ? vec3(0.03, 0.06, 0.15) : vec3(0.22, 0.035, 0.04);
    return pick < 0.7 ? dark : pick < 0.87 ? vec3(0.045, 0.045, 0.05) : vec3(0.5, 0.44, 0.34);
}

void main() {
    Pixel p = this_pixel();
    float seed = dot(p.albedo, vec3(97.0, 57.0, 31.0));
    Opening o = opening_of(p.material, random(vec2(floor(seed * 64.0), 17.0)));
    vec2 bay = floor(p.uv / BAY), place = p.uv - bay * BAY;
    float above_ground = step(0.0, p.uv.y);
    float opening = within(place, o.low, o.high, p.size) * above_ground;
    float glass = within(place, o.low + o.frame, o.high - o.frame, p.size) * above_ground;
    glass *= 1.0 - line_cover(place.x - 0.5 * BAY, o.mullion, p.size);
    float pick = random(bay + floor(seed * 64.0) + 4096.0), other = random(bay + 8192.0);

    vec4 stain = noise_at(p.uv / 14.0, p.size / 14.0);
    vec4 grain = noise_at(p.uv / 1.3, p.size / 1.3);
    vec3 wall = clad(p.albedo * (0.88 + 0.14 * stain.r + 0.12 * grain.g), p.material, p.uv, p.size);
    bool punched = p.material == MATERIAL_FACADE || p.material == MATERIAL_BRICK_FACADE || p.material == MATERIAL_TIMBER_FACADE;
    float shutters = p.material == MATERIAL_TIMBER_FACADE && random(vec2(seed, 29.0)) > 0.45
        ? within(place, vec2(o.low.x - 0.5, o.low.y), vec2(o.high.x + 0.5, o.high.y), p.size) * above_ground : 0.0;
    wall = mix(wall, p.albedo * vec3(0.22, 0.28, 0.25), shutters);
    float sill = within(place, vec2(o.low.x - 0.08, o.low.y - 0.10), vec2(o.high.x + 0.08, o.low.y), p.size);
    wall = punched ? mix(wall, vec3(0.55, 0.53, 0.49), sill * above_ground) : wall;
    vec3 panel = p.albedo * 0.35;
    wall = p.material == MATERIAL_OFFICE_GLASS ? mix(panel, wall, 0.35) : wall;
    vec3 sign_color = sign_tone(random(vec2(floor(bay.x / 3.0), floor(seed * 64.0) + 41.0)));
    float sign = p.material == MATERIAL_SHOPFRONT ? within(place, vec2(-1.0, 2.52), vec2(4.0, 2.9), p.size) : 0.0;
    wall = mix(wall, sign_color, sign);
    vec3 frame = punched ? vec3(0.62, 0.61, 0.58) : vec3(0.07, 0.075, 0.08);

    float curtain = step(0.55, pick) * span_cover(place.y, o.high.y - (0.25 + 0.9 * other), o.high.y, p.size);
    vec3 room = mix(vec3(0.018, 0.02, 0.024), vec3(0.30, 0.28, 0.25) * (0.5 + 0.5 * pick), curtain * 0.5);
    bool shop = p.material == MATERIAL_SHOPFRONT;
    vec3 goods = goods_on_display(p.uv, place.y, p.size);
    room = shop ? goods * 0.28 : room;
    float under_lintel = smoothstep(o.recess * 2.2, 0.0, o.high.y - place.y) * opening;

    Surface s = surface_of(p);
    s.albedo = mix(mix(wall, frame, opening), room, glass) * (1.0 - 0.55 * under_lintel);
    s.roughness = mix(0.85, 0.04, glass);
    s.normal = normalize(p.normal + glass * 0.05 * (vec3(pick, other, pick + other) - vec3(0.5, 0.5, 1.0)));
    s.specular = mix(0.035, p.material == MATERIAL_OFFICE_GLASS ? 0.12 : 0.06, glass);
    float lit_share = shop ? 1.0 - pow(1.0 - window_share, 4.0) : window_share;
    float is_lit = step(1.0 - lit_share, random(bay + floor(seed * 64.0) * vec2(1.0, 3.0) + window_seed + 16384.0)) * lamps_lit();
    vec2 room_at = vec2(floor(bay.x / (shop ? 3.0 : 2.0)), bay.y);  // neighbours have the same lamps
    float chosen = random(room_at + floor(seed * 64.0) * vec2(3.0, 1.0) + window_seed + 32768.0);
    vec3 tint = linear_color(window_colors[min(int(chosen * float(window_color_count)), window_color_count - 1)]);
    float inside = 0.55 + 0.45 * noise_at(p.uv / 2.1 + pick, p.size / 2.1).a - 0.35 * curtain;
    vec3 interior = shop ? goods * (0.25 + goods * 2.6) : vec3(inside * 0.85);
    float signs_lit = lamps_lit() * step(1e-6, window_share);
    s.emission = tint * glass * is_lit * interior + sign_color * sign * signs_lit * 0.5;
    shade(p, s);
}
