#version 330
// Visibility of light sources, on a grid of every VISIBILITY_STEP-th pixel: the share of sky and ground that nearby surfaces
// do not block, and the visible share of sun or moon. Both have noise with a 4 x 4 texel pattern, which smooth.frag averages.
// Openness: scalable ambient obscurance (McGuire, Mara, Luebke 2012).
#include "pixel"
#include "light"
#include "log_depth"
#include "tunnel"
uniform sampler2DShadow shadow_map;
uniform sampler2D contact_map;

out vec4 visibility;  // openness, sunlit, depth

const int TAPS = QUALITY == 0 ? 4 : 6;
const float TEXEL = QUALITY == 0 ? 2.0 : 1.0;  // size of a shadow map texel, in those of the medium quality
const int SHADOW_TAPS = QUALITY == 0 ? 1 : 2;
const float REACH = 1.1;      // meters
const mat2 TURN = mat2(-0.73737, 0.67549, -0.67549, -0.73737);  // rotation between taps: the golden angle
const float BIAS = 0.002;     // share of the depth, against banding on flat surfaces
const float STRENGTH = 4.0;
const float SHADOW_EDGE = 0.99;
const float PENUMBRA = 1.6;   // texels of the shadow map

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

// Share of the key light that arrives. The position is offset from the surface by about a texel to avoid shadow acne.
float sunlit(vec3 position, vec3 normal, vec2 aside) {
    float facing = dot(normal, key_direction.xyz);
    float slope = sqrt(max(1.0 - facing * facing, 0.0));
    vec3 near = (near_clip_from_world * vec4(position + normal * TEXEL * (0.02 + 0.05 * slope), 1.0)).xyz;
    vec3 far = (far_clip_from_world * vec4(position + normal * TEXEL * (0.06 + 0.2 * slope), 1.0)).xyz;
    bool is_near = max(abs(near.x), abs(near.y)) < SHADOW_EDGE;
    vec3 place = 0.5 + 0.5 * (is_near ? near : far);
    bool outside = max(abs(far.x), abs(far.y)) > SHADOW_EDGE;
    place.x = 0.5 * place.x + (is_near ? 0.0 : 0.5);  // the squares are side by side
    place.z -= TEXEL * (is_near ? 4e-5 : 1e-4);
    vec2 size = vec2(textureSize(shadow_map, 0));
    float light = 0.0;
    for (int tap = 0; tap < SHADOW_TAPS; ++tap) {
        vec2 offset = aside * (PENUMBRA * sqrt((float(tap) + 0.5) / float(SHADOW_TAPS)));
        light += texture(shadow_map, place + vec3(offset / size, 0.0));
        aside = TURN * aside;
    }
    return outside ? 1.0 : facing < -0.2 ? 0.0 : light / float(SHADOW_TAPS);
}

// Share of the sky that actors at this position block from the ground (render/lighting/contact_shadows.py).
float under_actors(vec3 position, vec3 normal) {
    vec2 contact = texture(contact_map, position.xy / (2.0 * noise_origin.w) + 0.5).xy;
    float above = abs(position.z - contact.y / max(contact.x, 1e-3));
    return min(contact.x, 0.9) * (1.0 - smoothstep(0.3, 0.8, above)) * smoothstep(0.5, 0.9, normal.z);
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
    open *= 1.0 - under_actors(position, normal);
    float sun = sunlit(position, normal, aside);
#if TUNNELS
    Tunnel tunnel = tunnel_at(position, normal);
    sun *= 1.0 - tunnel.inside * smoothstep(5.0, 40.0, tunnel.depth);
#endif
    visibility = vec4(open, sun, packed_log_depth(point.z));
}
