// Effects of lens and sensor on the light: vignetting, shot noise and read noise.
#include "film"
#include "random_words"
uniform float vignetting;  // exponent on cos⁴
uniform vec2 electrons;    // number of electrons at white; variance of the read noise
uniform uvec2 noise_seed;

// Three independent normal deviates of a pixel: Box, Muller.
vec3 normal_deviates(uvec2 texel) {
    vec4 even = (vec4(random_words(uvec4(texel, noise_seed)) >> 8u) + 0.5) / 16777216.0;
    vec2 radius = sqrt(-2.0 * log(even.xz));
    vec2 angle = 6.2831853 * even.yw;
    return vec3(radius.x * cos(angle.x), radius.x * sin(angle.x), radius.y * cos(angle.y));
}

// color: pixel of the ideal camera; tangent2: squared tangent of the angle between the pixel's ray and the optical axis.
vec3 through_lens(vec3 color, uvec2 texel, float tangent2) {
    vec3 signal = light_of(color) * pow(1.0 + tangent2, -2.0 * vignetting) * electrons.x;
    signal += sqrt(signal + electrons.y) * normal_deviates(texel);
    return film(max(signal / electrons.x, 0.0));
}
