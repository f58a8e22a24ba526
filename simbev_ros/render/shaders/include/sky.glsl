// Radiance of the sky without the shapes of clouds, and what a mirror would see of the surroundings.
#include "light"

vec3 sky_radiance(vec3 direction) {
    float height = max(direction.z, 0.0);
    vec3 sky = mix(horizon.rgb, zenith.rgb, 1.0 - exp2(-height * 4.0) * (1.0 - height));
    float towards_sun = max(dot(direction, sun_direction.xyz) * 0.5 + 0.5, 0.0);
    float halo = towards_sun * towards_sun;
    halo *= halo;
    halo *= halo;
    return sky + glow.rgb * halo * (0.25 + 0.75 * exp2(-height * 5.0)) + glow.rgb * 0.6 * pow(towards_sun, 90.0);
}

// Radiance that a surface mirrors: sky above, ground below, and a dark band of houses and trees between.
vec3 surroundings(vec3 direction, float roughness) {
    float blur = 0.06 + roughness * 0.5;
    vec3 below = mix(ground_ambient.rgb, sky_ambient.rgb * 0.22, smoothstep(-0.3, 0.05, direction.z));
    return mix(below, sky_radiance(direction), smoothstep(-blur, blur, direction.z - 0.12));
}
