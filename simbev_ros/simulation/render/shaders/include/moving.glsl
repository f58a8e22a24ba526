// Surfaces of the G-buffer at times around its own: each point moves straight on, relative to the camera.
// The unit of time is that of the motion; places are x and y where z is 1, in the optical frame.
#include "view"
uniform sampler2D g_motion;  // from motion.frag
uniform sampler2D fastest;   // from motion_tiles.frag, of the tiles around
uniform sampler2D slowest;

const int TILE = 32;
const float SAME_PX = 0.75, STILL_PX = 0.05, NEARLY = 0.05;
const float LATER = 0.999;  // later steps are more accurate

// Motions that may occur at a pixel: its own, and the fastest and the slowest one nearby.
struct Motions {
    vec3 own, fast, slow;
    float speed;   // of the fastest, pixels
    float uneven;  // difference of speeds across an edge nearby, pixels
};

vec2 ideal_pixel(vec2 place) { return place * intrinsics.xy + intrinsics.zw; }

vec2 place_of(ivec2 texel) { return (vec2(texel) - intrinsics.zw) / intrinsics.xy; }

vec2 speed_of(vec3 motion, vec2 place) { return (motion.xy - place * motion.z) * intrinsics.xy; }

vec4 motion_at(vec2 place) {
    return texelFetch(g_motion, clamp(ivec2(round(ideal_pixel(place))), ivec2(0), textureSize(g_motion, 0) - 1), 0);
}

Motions motions_around(vec2 place) {
    ivec2 tile = clamp(ivec2(round(ideal_pixel(place))) / TILE, ivec2(0), textureSize(fastest, 0) - 1);
    vec4 fast = texelFetch(fastest, tile, 0), slow = texelFetch(slowest, tile, 0);
    return Motions(motion_at(place).xyz, fast.xyz, slow.xyz, fast.w, slow.w);
}

// Where a point is at time 0 that has a motion and is seen at a place at another time.
vec2 place_now(vec2 place, vec3 motion, float time) { return place * max(1.0 + time * motion.z, NEARLY) - time * motion.xy; }

// Place at time 0 of the surface that is seen at a place at another time: of the surfaces whose motion leads there, the
// nearest one. If there is none, it was hidden at time 0, and the farthest surface nearby is the best guess.
vec2 surface_seen(vec2 place, Motions motions, float time) {
    vec3 motion = motions.own, found = vec3(place, -1.0), guess = vec3(place, 1e9);
    int steps = motions.uneven * abs(time) < SAME_PX ? SMOOTH_STEPS : 6;  // two for each motion
    if (motions.speed * abs(time) < STILL_PX) steps = 0;
    for (int k = 0; k < steps; ++k) {  // on CPUs, a shorter loop saves time, but a condition does not
        vec2 then = place_now(place, motion, time);
        vec4 there = motion_at(then);
        vec2 now = place_now(place, there.xyz, time), change_px = (now - then) * intrinsics.xy;
        float nearness = there.w / max(1.0 + time * there.z, NEARLY);
        if (dot(change_px, change_px) < SAME_PX * SAME_PX && nearness >= found.z * LATER) found = vec3(now, nearness);
        if (nearness < guess.z) guess = vec3(then, nearness);
        motion = (k & 1) == 0 ? there.xyz : k == 1 ? motions.fast : motions.slow;
    }
    return found.z >= 0.0 ? found.xy : guess.xy;
}
