// Light of sun or moon that arrives at a surface, from the shadow map (render/lighting/shadows.py).
#include "light"
#include "tunnel"
uniform sampler2DShadow shadow_map;

#define SUN_PER_PIXEL (QUALITY == 1)  // else visibility.frag finds it, on its coarser grid or with noise that is smoothed
const float TEXEL = QUALITY == 0 ? 2.0 : 1.0;  // size of a shadow map texel, in those of the medium quality
const int SHADOW_TAPS = QUALITY == 2 ? 2 : 1;
const float PENUMBRA = SUN_PER_PIXEL ? 0.0 : 1.6;  // texels of the shadow map
const float SHADOW_EDGE = 0.99;
const mat2 TURN = mat2(-0.73737, 0.67549, -0.67549, -0.73737);  // rotation between taps: the golden angle

// Share of the light that arrives. The position is offset from the surface by about a texel to avoid shadow acne.
float sunlit(vec3 position, vec3 normal, vec2 aside) {
    float facing = dot(normal, key_direction.xyz);
    if (facing < -0.2) return 0.0;
    float slope = sqrt(max(1.0 - facing * facing, 0.0));
    vec3 place = (near_clip_from_world * vec4(position + normal * TEXEL * (0.02 + 0.05 * slope), 1.0)).xyz;
    vec2 square = vec2(0.0, 4e-5);  // left edge in the texture, where the squares are side by side; bias
    if (max(abs(place.x), abs(place.y)) >= SHADOW_EDGE) {
        place = (far_clip_from_world * vec4(position + normal * TEXEL * (0.06 + 0.2 * slope), 1.0)).xyz;
        square = vec2(0.5, 1e-4);
    }
    if (max(abs(place.x), abs(place.y)) >= SHADOW_EDGE) return 1.0;
    place = 0.5 + 0.5 * place;
    place = vec3(0.5 * place.x + square.x, place.y, place.z - TEXEL * square.y);
    vec2 texel = 1.0 / vec2(textureSize(shadow_map, 0));
    float light = 0.0;
    for (int tap = 0; tap < SHADOW_TAPS; ++tap) {
        vec2 offset = aside * (PENUMBRA * sqrt((float(tap) + 0.5) / float(SHADOW_TAPS)));
        light += texture(shadow_map, place + vec3(offset * texel, 0.0));
        aside = TURN * aside;
    }
    light /= float(SHADOW_TAPS);
#if TUNNELS
    Tunnel tunnel = tunnel_at(position, normal);
    light *= 1.0 - tunnel.inside * smoothstep(5.0, 40.0, tunnel.depth);
#endif
    return light;
}
