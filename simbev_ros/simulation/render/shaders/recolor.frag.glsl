#version 330
// Random colors and patterns (section appearance of the configuration). Surfaces of the same color and material share them.
#include "enums"
#include "pixel"
#include "light"
#include "random_words"
uniform float strength;  // 0..1
uniform uint seed;

out vec4 color;  // as g_color: sRGB albedo, 2^shading class

const vec3 CROWN = vec3(5.0, 5.0, 20.0);  // leaves have a color each; within such a space, they get the same one
const float PLAUSIBLE = 0.3;  // share of surfaces that keep their color at full strength

void main() {
    Pixel p = this_pixel();
    color = texelFetch(g_color, shaded_pixel(), 0);
    vec3 place = p.position + noise_origin.xyz;
    uvec3 kind = p.material == MATERIAL_FOLIAGE ? uvec3(ivec3(floor(place / CROWN))) : uvec3(color.rgb * 255.0 + 0.5);
    uvec4 words = random_words(uvec4(kind, p.material) + seed * uvec4(1u, 257u, 65537u, 7u));
    vec4 own = vec4(words >> 8u) / 16777216.0, other = vec4(words.yzwx & 0xFFFFu) / 65535.0;
    if (own.w < PLAUSIBLE) return;
    vec3 cell = place * exp2(4.0 * other.w - 2.0);  // 0.25 to 4 per meter
    if (other.x < 0.5) cell.xy *= 0.25;
    vec3 checks = step(0.5, fract(cell)), waves = 0.5 + 0.5 * sin(6.2831853 * cell);
    float pattern = other.y < 0.4 ? 0.5 : other.y < 0.7 ? mod(checks.x + checks.y + checks.z, 2.0) : dot(waves, vec3(1.0 / 3.0));
    color.rgb = mix(color.rgb, own.xyz * (1.0 + 0.8 * other.z * (pattern - 0.5)), strength);
}
