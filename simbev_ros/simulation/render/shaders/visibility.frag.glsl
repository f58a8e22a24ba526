#version 330
// Visibility of light sources, on a grid of every VISIBILITY_STEP-th pixel: the share of sky and ground that nearby surfaces
// do not block, and the visible share of sun or moon. Both have noise with a 4 x 4 texel pattern, which smooth.frag averages.
// Openness: scalable ambient obscurance (McGuire, Mara, Luebke 2012).
#include "pixel"
#include "log_depth"
#include "sunlit"
uniform sampler2D contact_map;
uniform sampler2D sky_view;

out vec4 visibility;  // openness, sunlit, depth

const int TAPS = QUALITY == 0 ? 4 : 6;
const float REACH = 1.1;      // meters
const float BIAS = 0.002;     // share of the depth, against banding on flat surfaces
const float STRENGTH = 4.0;
const float BESIDE = 2.5;     // positions are moved this far along the normal, off their own walls
const float REFLECTED = 0.3;  // light that houses and trees reflect, over that of the sky behind them

vec3 optical_point(ivec2 texel) {
    float depth = min(texelFetch(g_depth, texel, 0).x, 1e4);
    return optical_ray(vec2(texel)) * depth;
}

float openness(ivec2 texel, vec3 point, vec3 normal, vec2 aside) {
    float reach_px = clamp(REACH * intrinsics.x / point.z, 2.0, viewport.y * 0.15);
    ivec2 last = ivec2(viewport.xy) - 1;
    float hidden = 0.0;
    for (int tap = 0; tap < TAPS; ++tap) {
        vec2 offset = aside * (reach_px * (float(tap) + 0.5) / float(TAPS));
        vec3 towards = optical_point(clamp(texel + ivec2(offset), ivec2(0), last)) - point;
        float distance2 = dot(towards, towards);
        float falloff = max(1.0 - distance2 / (REACH * REACH), 0.0);
        hidden += max(dot(towards, normal) - BIAS * point.z, 0.0) * inversesqrt(distance2 + 0.01) * falloff;
        aside = TURN * aside;
    }
    return max(1.0 - STRENGTH * hidden / float(TAPS), 0.0);
}

// Share of the sky that actors at this position block from the ground (render/lighting/contact_shadows.py).
float under_actors(vec3 position, vec3 normal) {
    vec2 contact = texture(contact_map, position.xy / (2.0 * noise_origin.w) + 0.5).xy;
    float above = abs(position.z - contact.y / max(contact.x, 1e-3));
    return min(contact.x, 0.9) * (1.0 - smoothstep(0.3, 0.8, above)) * smoothstep(0.5, 0.9, normal.z);
}

// Share of the sky's light that arrives between houses and trees (render/lighting/sky_view.py); they reflect some of the rest.
float between_houses(vec3 position, vec3 normal) {
    vec3 here = position + vec3(BESIDE * normal.xy, 0.0);
    vec4 found = texture(sky_view, here.xy * sky_view_place.w + sky_view_place.xy);
    float steepness = max(found.x - here.z - sky_view_place.z, 0.0) * found.y;
    float open = 1.0 / (1.0 + steepness * steepness) + 1.5708 * dot(found.zw, normal.xy);
    return mix(REFLECTED, 1.0, clamp(open, 0.0, 1.0));
}

void main() {
    ivec2 cell = ivec2(gl_FragCoord.xy);
    ivec2 texel = min(cell * VISIBILITY_STEP, ivec2(viewport.xy) - 1);
    vec3 point = optical_point(texel);
    vec3 normal = unpack_normal(texelFetch(g_surface, texel, 0).y);
    vec3 position = (world_from_optical * vec4(point, 1.0)).xyz;
    int pattern = (cell.x & 3) * 4 + (cell.y & 3);
    float angle = float((pattern * 7) & 15) * (6.2831853 / 16.0);
    vec2 aside = vec2(cos(angle), sin(angle));
    float open = openness(texel, point, transpose(mat3(world_from_optical)) * normal, aside);
    open *= (1.0 - under_actors(position, normal)) * between_houses(position, normal);
    float sun = SUN_PER_PIXEL ? 1.0 : sunlit(position, normal, aside);
    visibility = vec4(open, sun, packed_log_depth(point.z));
}
