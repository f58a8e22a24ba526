#version 330
// Color image of a camera with lens and sensor, from that of an ideal camera.
#include "view"
#include "lens"
uniform sampler2D ideal_rgb;
#ifdef FISHEYE
#include "fisheye"
#elif DISTORTED
#include "plumb_bob"
#endif
out vec4 rgb;

// Weights of four texels for a position between the second and the third: Catmull, Rom.
vec4 weights(float share) {
    float square = share * share, cube = square * share;
    return vec4(-0.5 * cube + square - 0.5 * share, 1.5 * cube - 2.5 * square + 1.0,
                -1.5 * cube + 2.0 * square + 0.5 * share, 0.5 * cube - 0.5 * square);
}

vec3 interpolated(vec2 pixel) {
    ivec2 first = ivec2(floor(pixel)) - 1;
    vec4 across = weights(fract(pixel.x)), down = weights(fract(pixel.y));
    vec3 color = vec3(0.0);
    for (int row = 0; row < 4; ++row)
        for (int column = 0; column < 4; ++column)
            color += down[row] * across[column] * texelFetch(ideal_rgb, first + ivec2(column, row), 0).rgb;
    return clamp(color, 0.0, 1.0);
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
#if DISTORTED
#if defined(FISHEYE) && !defined(COMPUTED)
    if (!in_face(texel)) discard;
#endif
    vec2 place = lens_ray(texel).xy;
    vec3 color = interpolated(place * intrinsics.xy + intrinsics.zw);
#else
    vec2 place = optical_ray(vec2(texel)).xy;
    vec3 color = texelFetch(ideal_rgb, texel, 0).rgb;
#ifdef FISHEYE
    if (!in_circle(texel)) color = vec3(0.0);
#endif
#endif
#if SENSOR
#ifdef FISHEYE
    float tangent2 = inversesqrt(texelFetch(lens_rays, texel, 0).w) - 1.0;  // so that the solid angle takes the place of cos⁴
#else
    float tangent2 = dot(place, place);
#endif
    color = through_lens(color, uvec2(texel), tangent2);
#endif
    rgb = vec4(color, 1.0);
}
