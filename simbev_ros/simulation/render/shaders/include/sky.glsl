// Radiance of the sky with its clouds, and of the surroundings in reflections.
#include "air"
#include "dome"
uniform sampler2D sky_dome;  // radiance; share of the light from beyond that passes through clouds and fog

// Height of the surrounding houses and trees, as the sine of their altitude, and their radiance in the sky's light.
#ifdef SKYLINE  // set by materials that reflect so sharply that these shapes are visible; they include noise first
vec2 skyline(vec3 direction) {
    float share = direction.x / (abs(direction.x) + abs(direction.y) + 1e-4);
    float around = 8.0 * (direction.y < 0.0 ? 3.0 + share : 1.0 - share);  // increases once around the horizon, over 32 houses
    vec2 left = randoms(vec2(floor(around), 7.0)).xy, right = randoms(vec2(mod(floor(around) + 1.0, 32.0), 7.0)).xy;
    vec2 house = mix(left, right, smoothstep(0.44, 0.56, fract(around)));
    float facing = max(-dot(direction.xy, key_direction.xy), 0.0) * key_light.g / (sky_ambient.g + 1e-3);
    return vec2(0.04 + 0.26 * house.x * house.x, (0.14 + 0.16 * house.y) * (1.0 + 0.35 * facing));
}
#else
vec2 skyline(vec3 direction) { return vec2(0.12, 0.22); }
#endif

// Radiance that a surface reflects: sky above, ground below, and a dark band of houses and trees between.
vec3 surroundings(vec3 direction, float roughness) {
    vec2 house = skyline(direction);
    float blur = 0.06 + roughness * 0.5;
    vec3 below = mix(ground_ambient.rgb, sky_ambient.rgb * house.y, smoothstep(-0.3, 0.05, direction.z));
#ifdef MATT  // set by materials so rough that they reflect only the mean of the sky
    vec3 above = sky_ambient.rgb;
#else
    vec3 above = textureLod(sky_dome, dome_place(direction), 0.0).rgb;
#endif
    return mix(below, above, smoothstep(-blur, blur, direction.z - house.x));
}
