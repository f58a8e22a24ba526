// Interior of cars, vans, trucks and buses as seen through their windows: seats, a driver and passengers unless the
// vehicle is parked, and the windows on the far side.
#include "rigid"
uniform usampler2D rigid_actors;

const float SEAT = 0.38;  // meters from the center
const float BENCH = 0.85; // meters from a car's front seats to those behind
const float ROW = 0.8;    // meters between the seats of a bus

struct Cabin {  // meters, actor frame
    vec3 low, high;
    float belt;         // lower edge of the windows
    bool has_rear_window;
};

// size: length, width, height of the vehicle.
Cabin cabin_of(uint tag, vec3 size) {
    bool car = tag == TAG_CAR, bus = tag == TAG_BUS;
    float ahead = car ? 0.2 * size.x : 0.5 * size.x - (size.x < 6.5 ? 1.0 : 0.3);
    float behind = car ? -0.36 * size.x : bus ? -0.47 * size.x : ahead - 1.8;
    float belt = size.z * (car ? 0.67 : bus ? 0.40 : 0.53), roof = car ? size.z - 0.09 : size.z * 0.88;
    float side = size.y * (car ? 0.35 : 0.42);
    return Cabin(vec3(behind, -side, belt - 0.6), vec3(ahead, side, roof), belt, car);
}

// Whether a ray meets an ellipsoid, with a soft edge.
float meets(vec3 from, vec3 ray, vec3 middle, vec3 radius) {
    vec3 to = (middle - from) / radius, way = ray / radius;
    float along = dot(to, way);
    return along > 0.0 ? (1.0 - smoothstep(0.84, 1.08, dot(to, to) - along * along / dot(way, way))) : 0.0;
}

// Seen radiance with a person's head and body before it. own: random numbers of the person.
vec3 with_person(vec3 seen, vec3 from, vec3 ray, vec3 head, vec4 own, vec3 daylight) {
    vec3 hair = mix(vec3(0.03, 0.022, 0.017), vec3(0.22, 0.16, 0.10), own.x * own.x * own.x);
    vec3 skin = mix(vec3(0.32, 0.20, 0.15), vec3(0.07, 0.04, 0.028), own.w * own.w);
    float top = from.z + ray.z * dot(head - from, ray) / dot(ray, ray) - head.z;
    vec3 face = mix(ray.x < 0.3 ? skin : hair, hair, smoothstep(0.03, 0.06, top));
    vec3 clothes = mix(own.yzw, own.yyy, 0.6);
    seen = mix(seen, (clothes * clothes * 0.4 + 0.02) * daylight, meets(from, ray, head + vec3(0.0, 0.0, -0.42), vec3(0.13, 0.23, 0.30)));
    return mix(seen, face * daylight, meets(from, ray, head, vec3(0.10, 0.085, 0.125)));
}

// Radiance of the interior. looks: the actor's row of render/geometry/rigid_table.py; beyond: radiance beyond the far side.
vec3 cabin_behind(Pixel p, uvec4 looks, vec3 beyond) {
    vec3 x = rigid_texel(p.row, 0).xyz, y = rigid_texel(p.row, 1).xyz, z = rigid_texel(p.row, 2).xyz;
    vec3 foot = vec3(rigid_texel(p.row, 0).w, rigid_texel(p.row, 1).w, rigid_texel(p.row, 2).w);
    mat3 world_from_actor = transpose(mat3(x, y, z));
    vec3 from = (p.position - foot) * world_from_actor, ray = -p.to_camera * world_from_actor;
    ray += mix(vec3(-1e-4), vec3(1e-4), greaterThan(ray, vec3(0.0)));
    uint tag = looks.w >> 24u;
    vec3 size = vec3((uvec3(looks.w) >> uvec3(0u, 8u, 16u)) & 0xFFu) * vec3(0.1, 0.02, 0.02);
    Cabin cabin = cabin_of(tag, size);
    if (abs(from.y) > size.y * (tag == TAG_CAR ? 0.415 : 0.468)) return vec3(0.0);  // a mirror

    vec3 ends = (mix(cabin.low, cabin.high, greaterThan(ray, vec3(0.0))) - from) / ray;
    float least = max(min(ends.x, min(ends.y, ends.z)), 0.0);
    vec3 far = from + ray * least;
    vec3 head = vec3(cabin.high.x - 1.0, SEAT, mix(cabin.belt, cabin.high.z, 0.45));
    float pillar = (1.0 - smoothstep(0.06, 0.09, abs(far.x - head.x + 0.25))) * step(ends.y, ends.x);
    float window = smoothstep(-0.02, 0.02, far.z - cabin.belt) * step(least, min(ends.x, ends.y)) * (1.0 - pillar);
    if (ends.x < ends.y && ray.x < 0.0 && !cabin.has_rear_window) window = 0.0;

    vec4 own = randoms(vec2(float(looks.x), 3.0));
    vec3 daylight = sky_ambient.rgb * 0.4 + key_light.rgb * 0.05;
    vec3 seat = vec3(0.03 + 0.12 * own.x * own.x);
    vec3 seen = mix(vec3(far.z > cabin.belt ? 0.16 : 0.03) * daylight, beyond, window);
    float rests = meets(from, ray, head + vec3(-1.05, -SEAT, -0.36), vec3(0.13, 0.60, 0.34));
    rests = tag == TAG_CAR ? rests : 0.0;
    seen = mix(seen, seat * daylight, rests);
    bool forward = ray.x > 0.0, parked = (looks.y >> 16u & BEHAVIOR_PARKED) != 0u;
    vec4 taken = parked ? vec4(0.0) : vec4(1.0, step(0.62, randoms(vec2(float(looks.x), 5.0)).xyz - vec3(0.0, 0.2, 0.25)));
    for (int turn = 0; turn < 4; ++turn) {  // seats from the far to the near ones: driver, beside, and the bench of cars
        int place = forward ? 3 - (turn ^ 2) : 3 - turn;
        bool bench = place > 1;
        if (bench && tag != TAG_CAR) continue;
        vec3 at = head + vec3(bench ? -BENCH : 0.0, (place & 1) == 0 ? 0.0 : -2.0 * SEAT, 0.0);
        float chair = 0.0;
        if (!bench) {
            vec3 back = at + vec3(-0.17, 0.0, -0.44);
            chair = max(meets(from, ray, back, vec3(0.09, 0.25, 0.38)), meets(from, ray, back + vec3(-0.05, 0.0, 0.39), vec3(0.05, 0.145, 0.075)));
        }
        // From the front the person hides the seat, from behind the seat hides the person.
        if (!forward) seen = mix(seen, seat * daylight, chair);
        if (taken[place] > 0.5) {
            vec4 person = place == 0 ? own : randoms(vec2(float(looks.x), 7.0 + float(place)));
            seen = with_person(seen, from, ray, at, person, daylight);
        }
        if (forward) seen = mix(seen, seat * daylight, chair);
    }
    if (tag == TAG_BUS && !parked && from.x < head.x - 0.6) {  // passengers beside the windows
        float beside = sign(from.y) * (cabin.high.y - 0.32), row = floor((from.x + ray.x * (beside - from.y) / ray.y) / ROW);
        vec4 person = randoms(vec2(float(looks.x) + (from.y > 0.0 ? 0.0 : 4096.0), row + 64.0));
        vec3 at = vec3((row + 0.5) * ROW, beside, cabin.belt + 0.34);
        if (person.x + person.y < 0.8) seen = with_person(seen, from, ray, at, person, daylight);
    }
    float tint = from.x < head.x - 0.4 ? 0.5 : 0.8;
    return seen * tint;
}
