// Interior behind a pane: a box, intersected with the ray from the camera (interior mapping, van Dongen 2008).
#include "noise"

struct Inside {
    vec3 albedo;
    float daylight;  // share of the sky's light that enters through the window
};

// Intersection of a ray from the pane, at (x, y) of a room's front, with its far sides. sight: along, up, out of the wall.
// Returns the position, z into the room, and the side: 0 left or right, 1 floor or ceiling, 2 back.
vec4 far_side(vec2 place, vec3 room, vec3 sight) {
    vec3 ray = vec3(sight.xy, max(-sight.z, 0.05));
    ray.xy = mix(vec2(-1e-4), vec2(1e-4), greaterThan(ray.xy, vec2(0.0))) + ray.xy;
    vec3 steps = (mix(vec3(0.0), room, greaterThan(ray, vec3(0.0))) - vec3(place, 0.0)) / ray;
    float least = min(steps.x, min(steps.y, steps.z));
    return vec4(vec3(place, 0.0) + ray * least, steps.z == least ? 2.0 : steps.y == least ? 1.0 : 0.0);
}

Inside room_behind(vec2 place, vec3 sight, vec2 bay, vec4 pick, bool office) {
    vec3 room = office ? vec3(12.0, 2.8, 7.0) : vec3(3.0, 2.8, 3.6);
    vec2 at = vec2(clamp(place.x, 0.01, 2.99) + (office ? 3.0 * mod(bay.x, 4.0) : 0.0), clamp(place.y, 0.01, 2.79));
    vec4 hit = far_side(at, room, sight);
    vec3 paint = mix(vec3(0.36, 0.33, 0.28), vec3(0.25, 0.29, 0.31), pick.z) * (0.7 + 0.5 * pick.w);
    // Cupboards, shelves and pictures at the wall; rows of lamps at an office's ceiling.
    vec4 thing = randoms(floor(hit.xy / vec2(0.75, 1.1)) + bay * 7.0 + 512.0);
    float piece = hit.w == 1.0 ? 0.0 : step(thing.x, hit.y < 1.1 ? 0.65 : 0.22);
    vec3 wall = mix(paint, vec3(0.10, 0.075, 0.05) + 0.22 * thing.yzw * thing.y, piece);
    vec3 level = hit.y > 1.0 ? vec3(0.5, 0.49, 0.46) : vec3(0.14, 0.09, 0.055);
    float rows = office && hit.y > 1.0 && abs(fract(hit.z / 1.5) - 0.5) < 0.12 ? 1.1 : 0.0;
    vec3 albedo = (hit.w == 1.0 ? level : wall) + rows;
    return Inside(albedo, 0.30 / (1.0 + 0.45 * hit.z * hit.z));
}

// A shop: shelves at the back, lamps at the ceiling, and tables and stands near the pane.
Inside shop_behind(vec2 place, vec3 sight, float bay, float building, float size) {
    vec2 at = vec2(place.x + 3.0 * mod(bay, 3.0), clamp(place.y, 0.01, 2.69));
    vec4 hit = far_side(vec2(clamp(at.x, 0.01, 8.99), at.y), vec3(9.0, 2.7, 5.0), sight);
    vec2 along = vec2(hit.w == 2.0 ? hit.x : hit.z + 17.0, hit.y);
    vec4 trade = randoms(vec2(floor(bay / 3.0) + 33.0, building * 61.0 + 12.0));  // kind of goods: books, clothes on rails, furniture ..
    vec2 shelf = trade.w < 0.35 ? vec2(0.28, 0.42) : trade.w < 0.7 ? vec2(0.09, 1.05) : vec2(0.9, 0.7);
    vec3 paint = (0.19 + 0.2 * trade.x) * mix(vec3(1.08, 1.0, 0.9), vec3(0.93, 1.0, 1.03), trade.y);
    vec4 good = randoms(floor(along / shelf) + building + 37.0 * floor(bay / 3.0) + 99.0);
    float top = fract(along.y / shelf.y), board = 1.0 - step(0.07, top);
    vec3 tone = mix(vec3(good.y), good.yzw * vec3(1.0, 0.85, 0.7), 0.4) * 0.34 + 0.03;
    float reach = shelf.x < 0.1 ? 0.95 - top : top;  // clothes hang from rails
    vec3 stock = reach < 0.25 + 0.65 * good.x ? tone : paint * 0.35;
    vec3 wall = along.y < 2.15 ? mix(stock, paint, board) : paint;
    bool lamp = abs(fract(hit.z / 1.6) - 0.5) < 0.1 && abs(fract(hit.x / 2.2) - 0.5) < 0.34;
    vec3 level = hit.y > 1.0 ? vec3(0.30) + (lamp ? 2.0 : 0.0) : vec3(0.19, 0.16, 0.13);
    Inside inside = Inside(hit.w == 1.0 ? level : wall, 0.22 / (1.0 + 0.12 * hit.z * hit.z));

    vec2 near = at + sight.xy / max(-sight.z, 0.05) * 0.6;  // tables and stands 0.6 m behind the pane
    vec4 kind = randoms(vec2(floor(near.x / 1.3) + 311.0, building + floor(bay / 3.0)));
    vec2 off = vec2(fract(near.x / 1.3) * 1.3, near.y);
    float height = 0.55 + 0.45 * kind.z;
    float cover = span_cover(off.x, 0.12, 0.6 + 0.5 * kind.y, size) * span_cover(off.y, 0.3, height, size);
    vec4 item = randoms(floor(near / vec2(0.19, 2.0)) + 57.0);  // items on the tables
    float placed = span_cover(off.x, 0.16, 0.56 + 0.5 * kind.y, size) * span_cover(off.y, height, height + 0.08 + 0.3 * item.x, size) * step(0.3, item.y);
    vec3 cloth = mix(vec3(kind.w), vec3(kind.w, 0.8 * kind.w, 0.6 * kind.w), 0.6) * 0.42 + 0.04;
    vec3 thing = mix(vec3(item.z), item.zwy, 0.35) * 0.42 + 0.03;
    float shown = step(kind.x, 0.7);
    inside.albedo = mix(mix(inside.albedo, cloth, cover * shown), thing, placed * shown);
    inside.daylight = mix(inside.daylight, 0.30, max(cover, placed) * shown);
    return inside;
}
