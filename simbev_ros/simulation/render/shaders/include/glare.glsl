// Lamps as the camera sees them from a distance (render/lighting/glare.py).
#include "air"
uniform sampler2D g_depth;
in vec3 in_at;        // world
in vec3 in_facing;
in vec4 in_color;     // linear RGB; candela
in vec2 in_form;      // 0 shines all around, 1 only ahead; height above the ground

const float USUAL_EXPOSURE = 6.5;
const float LAMP = 0.07;           // meters
const float DEPTH_MARGIN = 0.35;  // distance of a lamp's center behind its lens, meters

vec2 pixel_of(vec3 position) {
    vec4 clip = clip_from_world * vec4(position, 1.0);
    return (clip.xy / clip.w * 0.5 + 0.5) * viewport.xy;
}

float distance_ahead(vec3 position) { return (clip_from_world * vec4(position, 1.0)).w; }

vec4 clip_of(vec2 pixel) { return vec4(pixel / viewport.xy * 2.0 - 1.0, 0.0, 1.0); }

// Share of the surroundings of a lamp, up to an extent in meters, that is visible; parts outside the image count as visible.
float seen_share(vec3 at, float extent) {
    float depth = distance_ahead(at);
    vec2 middle = pixel_of(at);
    float radius = max(extent * intrinsics.x / depth, 0.5), seen = 0.0;
    for (int tap = 0; tap < 9; ++tap) {
        ivec2 texel = ivec2(middle + radius * (vec2(tap % 3, tap / 3) - 1.0));
        bool outside = min(texel.x, texel.y) < 0 || texel.x >= int(viewport.x) || texel.y >= int(viewport.y);
        float found = texelFetch(g_depth, clamp(texel, ivec2(0), ivec2(viewport.xy) - 1), 0).x;
        seen += outside || found > depth - DEPTH_MARGIN ? 1.0 / 9.0 : 0.0;
    }
    return seen;
}

// Share of the lamp's intensity that is emitted toward a position.
float sent_to(vec3 offset) {
    float ahead = max(dot(in_facing, normalize(offset)), 0.0);
    return mix(1.0, ahead * ahead, in_form.x);
}

float clear_share(float distance, float height) {
    return exp2(-fog_depth(world_from_optical[3].z, height, distance) - distance * fog.w);
}
