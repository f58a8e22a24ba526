#version 330
// Walls with windows, curtain walls and shop fronts. uv: along the wall, up; 3 m per bay, 3 m per story.
#define SKYLINE
#include "enums"
#include "noise"
#include "lighting"
#include "masonry"
#include "room"

uniform vec3 window_colors[8];  // sRGB
uniform int window_color_count;
uniform float window_share;  // share of lit windows of rooms; 0: all lights of buildings are off
uniform float window_seed;

const float BAY = 3.0;
const float BOARD = 0.18;
const float SHEET = 0.30;
const vec3 DIRT = vec3(0.085, 0.078, 0.068);

struct Opening {  // opening in one bay, meters
    vec2 low, high;
    float frame;    // width of the frame around the glass
    float mullion;  // half width of the vertical bar in the middle
    float recess;   // depth of the glass behind the wall
};

// form: 0..1, constant within a building.
Opening opening_of(uint material, float form) {
    if (material == MATERIAL_OFFICE_GLASS) return Opening(vec2(0.04, 0.75), vec2(2.96, 2.96), 0.03, 0.03, 0.04);
    if (material == MATERIAL_SHOPFRONT) return Opening(vec2(0.12, 0.30), vec2(2.88, 2.45), 0.05, 0.025, 0.12);
    if (material == MATERIAL_CONCRETE_FACADE) return Opening(vec2(0.25, 0.90), vec2(2.75, 2.45), 0.06, 0.03, 0.16);
    if (material == MATERIAL_METAL_FACADE) return Opening(vec2(-0.10, 1.20), vec2(3.10, 2.30), 0.05, 0.03, 0.06);
    if (material == MATERIAL_TIMBER_FACADE) return Opening(vec2(1.00, 0.85), vec2(2.00, 2.25), 0.08, 0.025, 0.06);
    if (form < 0.3) return Opening(vec2(1.00, 0.70), vec2(2.00, 2.45), 0.06, 0.025, 0.18);
    if (form > 0.8) return Opening(vec2(0.60, 0.95), vec2(2.40, 2.35), 0.06, 0.03, 0.16);
    return Opening(vec2(0.85, 0.85), vec2(2.15, 2.40), 0.06, 0.025, 0.18);
}

// The wall's own pattern: bricks, boards, panels or corrugated sheets. weather: 0..1 noise.
vec3 clad(vec3 wall, uint material, vec2 uv, float weather, float size) {
    if (material == MATERIAL_BRICK_FACADE) return brickwork(wall, uv, weather, size);
    if (material == MATERIAL_TIMBER_FACADE) {
        float lap = stripe_cover(uv.y / BOARD, 0.12, size / BOARD);
        float tone = (random(vec2(floor(uv.y / BOARD) + 8192.0, floor(uv.x / 3.7 + 0.37 * floor(uv.y / BOARD)))) - 0.5) * 0.14;
        return wall * (1.0 + tone * seen_apart(BOARD, size) - 0.55 * lap);
    }
    if (material == MATERIAL_CONCRETE_FACADE) {
        float tone = (random(floor(uv / BAY) + 8192.0) - 0.5) * 0.14;
        return wall * (1.0 + tone) * (1.0 - 0.6 * joint_cover(uv + 0.015, vec2(BAY), 0.03, size));
    }
    if (material == MATERIAL_METAL_FACADE) {
        float seen = (1.0 - smoothstep(0.12, 0.5, size / SHEET));
        return wall * (1.0 + 0.22 * wave(uv.x / SHEET) * seen);
    }
    return wall;
}

float within(vec2 place, vec2 low, vec2 high, float size) {
    return span_cover(place.x, low.x, high.x, size) * span_cover(place.y, low.y, high.y, size);
}

// Shop fascias: dark green, navy, burgundy, charcoal or cream.
vec3 sign_tone(float pick) {
    vec3 dark = pick < 0.25 ? vec3(0.025, 0.07, 0.05) : pick < 0.5 ? vec3(0.03, 0.05, 0.11) : vec3(0.16, 0.035, 0.04);
    return pick < 0.7 ? dark : pick < 0.87 ? vec3(0.045, 0.045, 0.05) : vec3(0.42, 0.38, 0.31);
}

// Components along the wall, up, and outward.
vec3 in_wall(vec3 direction, vec3 normal) {
    vec2 out_of = normal.xy * inversesqrt(max(dot(normal.xy, normal.xy), 1e-4));
    return vec3(dot(direction.xy, vec2(-out_of.y, out_of.x)), direction.z, dot(direction.xy, out_of));
}

void main() {
    Pixel p = this_pixel();
    float building = floor(dot(p.albedo, vec3(97.0, 57.0, 31.0)) * 64.0);
    Opening o = opening_of(p.material, random(vec2(building, 17.0)));
    bool shop = p.material == MATERIAL_SHOPFRONT, office = p.material == MATERIAL_OFFICE_GLASS;
    bool punched = p.material == MATERIAL_FACADE || p.material == MATERIAL_BRICK_FACADE || p.material == MATERIAL_TIMBER_FACADE;
    vec2 bay = floor(p.uv / BAY), place = p.uv - bay * BAY;
    float above_ground = step(0.0, p.uv.y);
    vec4 pick = randoms(bay + building + 4096.0);

    // The pane lies behind the wall: the visible parts of it and of the reveal around it shift with the view.
    vec3 sight = in_wall(-p.to_camera, p.normal), sun = in_wall(key_direction.xyz, p.normal);
    float inward = max(-sight.z, 0.12);
    vec2 deep = place + sight.xy / inward * o.recess;
    float opening = within(place, o.low, o.high, p.size) * above_ground;
    float back = within(deep, o.low, o.high, p.size) * opening;
    float mullion = line_cover(deep.x - 0.5 * BAY, o.mullion, p.size);
    float transom = punched ? line_cover(deep.y - mix(o.low.y, o.high.y, 0.68), 0.02, p.size) : 0.0;
    float glass = within(deep, o.low + o.frame, o.high - o.frame, p.size) * opening * (1.0 - max(mullion, transom));
    float sunny = sun.z > 0.0 ? within(deep + sun.xy / max(sun.z, 0.12) * o.recess, o.low, o.high, p.size + 0.01) : 1.0;

    vec4 grain = texture_at(p.uv, 5.7, p.size);
#if QUALITY >= 1
    float streaks = texture_at(p.uv * vec2(1.61, 0.161), 3.7, p.size).b;
#else
    float streaks = grain.b;
#endif
    vec3 wall = clad(p.albedo, p.material, p.uv, grain.a, p.size) * (0.84 + 0.20 * grain.r + 0.12 * grain.g);
    // Rain washes dirt down from the ends of sills, and splashes it up at the foot of the wall.
    float below_sill = span_cover(place.x, o.low.x - 0.15, o.high.x + 0.15, 0.2) * smoothstep(o.low.y - 1.6, o.low.y - 0.1, place.y) * step(place.y, o.low.y);
    float splashed = (1.0 - smoothstep(0.0, 0.9, p.uv.y)) * above_ground;
    float dirt = 0.30 * streaks * streaks + (punched ? 0.75 : 0.3) * below_sill * smoothstep(0.45, 0.95, streaks) + 0.7 * splashed * smoothstep(0.2, 0.9, grain.b);
    wall = mix(wall, DIRT, min(dirt * (office || shop ? 0.15 : 0.5), 0.6));

    float shutters = p.material == MATERIAL_TIMBER_FACADE && random(vec2(building, 29.0)) > 0.45
        ? within(place, vec2(o.low.x - 0.5, o.low.y), vec2(o.high.x + 0.5, o.high.y), p.size) * above_ground : 0.0;
    float slats = 1.0 - 0.5 * stripe_cover(place.y / 0.07, 0.3, p.size / 0.07);
    wall = mix(wall, p.albedo * vec3(0.22, 0.28, 0.25) * slats, shutters);
    float sill = within(place, vec2(o.low.x - 0.08, o.low.y - 0.10), vec2(o.high.x + 0.08, o.low.y), p.size);
    float lintel = p.material == MATERIAL_BRICK_FACADE ? within(place, vec2(o.low.x - 0.12, o.high.y), vec2(o.high.x + 0.12, o.high.y + 0.22), p.size) : 0.0;
    wall = mix(wall, vec3(0.40, 0.38, 0.35) * (0.8 + 0.3 * grain.g), (punched ? max(sill, lintel) : 0.0) * above_ground);
    wall = office ? mix(p.albedo * 0.35, wall, 0.35) : wall;
    vec3 sign_color = sign_tone(random(vec2(floor(bay.x / 3.0), building + 41.0)));
    float sign = shop ? within(place, vec2(-1.0, 2.52), vec2(4.0, 2.9), p.size) : 0.0;
    wall = mix(wall, sign_color, sign);

    // The reveal: dark at the top, lit on the sill, intermediate at the sides.
    float reveal = opening * (1.0 - back);
    vec3 reveal_color = wall * (deep.y > o.high.y ? 0.35 : deep.y < o.low.y ? 0.95 : 0.7);
    vec3 frame = punched ? vec3(0.55, 0.54, 0.51) : vec3(0.07, 0.075, 0.08);
    frame *= 0.45 + 0.55 * sunny;

    // Blinds from above, curtains at the sides; the cloth hangs in folds.
    float blind = pick.x > 0.62 ? span_cover(deep.y, o.high.y - (0.25 + 1.1 * pick.y) * (shop ? 0.0 : 1.0), o.high.y, p.size) : 0.0;
    float drawn = punched && pick.x < 0.42 ? 0.10 + 0.35 * pick.y * (o.high.x - o.low.x) : 0.0;
    float drape = 1.0 - span_cover(deep.x, o.low.x + drawn, o.high.x - drawn, p.size + 0.03);
    float folds = 0.8 + 0.2 * wave(deep.x * 8.3) * clamp(1.2 - p.size * 25.0, 0.0, 1.0);
    float cloth = max(blind, drape);
    vec3 cloth_color = mix(vec3(0.42, 0.40, 0.36), vec3(0.30, 0.24, 0.19), pick.z) * mix(folds, 1.0, blind) * (0.35 + 0.3 * sunny);

#if QUALITY >= 1
    Inside inside = shop ? shop_behind(deep, sight, bay.x, building, p.size) : room_behind(deep, sight, bay, pick, office);
#else
    float lighter = smoothstep(0.4, 2.6, deep.y) - 0.5 * step(deep.y, 1.3) * float(shop);
    Inside inside = Inside(vec3(0.22, 0.20, 0.17) * max(lighter, 0.15), 0.25);
#endif
    float seen_through = glass * (1.0 - cloth);

    Surface s = surface_of(p);
    s.albedo = mix(wall, reveal_color, reveal);
    s.albedo = mix(s.albedo, frame, back * (1.0 - glass));
    s.albedo = mix(s.albedo, cloth_color * cloth, glass);
    s.roughness = mix(office ? 0.25 : sign > 0.5 ? 0.35 : 0.85, 0.03, glass);
    s.normal = normalize(p.normal + glass * 0.022 * (pick.zwx - 0.5) * vec3(1.0, 1.0, 0.6));
    s.specular = mix(0.035, office ? 0.30 : 0.11, glass);
    vec3 daylight = sky_ambient.rgb * inside.daylight + (shop ? vec3(0.11, 0.10, 0.08) : vec3(0.0));
    s.emission = inside.albedo * daylight * exposure() * seen_through;

    float lit_share = shop ? 1.0 - pow(1.0 - window_share, 4.0) : window_share;
    float is_lit = step(1.0 - lit_share, random(bay + building * vec2(1.0, 3.0) + window_seed + 16384.0)) * lamps_lit();
    vec2 room_at = vec2(floor(bay.x / (shop ? 3.0 : 2.0)), bay.y);  // adjacent windows of a room have the same lamps
    float chosen = random(room_at + building * vec2(3.0, 1.0) + window_seed + 32768.0);
    vec3 tint = linear_color(window_colors[min(int(chosen * float(window_color_count)), window_color_count - 1)]);
    vec3 lamplit = mix(inside.albedo * 0.85, vec3(0.50, 0.45, 0.40) * folds, cloth);
    float signs_lit = lamps_lit() * step(1e-6, window_share);
    s.emission += tint * glass * is_lit * lamplit + sign_color * sign * signs_lit * 0.5;
    shade(p, s);
}
