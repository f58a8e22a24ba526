#version 330
// Sky and clouds from their map, with the sun or the moon and stars.
#include "lighting"
#include "noise"

const float SUN_RADIUS = 0.0075;  // radians; larger than real, as lenses show it
const float MOON_RADIUS = 0.0085;

vec3 stars(vec3 direction) {
    vec2 grid = direction.xy / (1.0 + max(direction.z, 0.0)) * 260.0;
    vec2 cell = floor(grid);
    float pick = random(cell + 700.0);
    float near = length(fract(grid) - 0.3 - 0.4 * vec2(random(cell + 900.0), random(cell + 1300.0)));
    return vec3(step(0.975, pick) * (1.0 - smoothstep(0.0, 0.28, near)) * (pick - 0.97) * 3.6);
}

void main() {
    vec3 direction = normalize(mat3(world_from_optical) * optical_ray(vec2(shaded_pixel())));
    direction = direction.z < 0.0 ? normalize(vec3(direction.xy, 0.0)) : direction;
    vec4 sky = textureLod(sky_dome, dome_place(direction), 0.0);
    float edge = 1.0 / intrinsics.x;
    float from_key = length(direction - key_direction.xyz);
    vec3 beyond = vec3(0.0);
    if (lamps_lit() > 0.0) {
        float dark = (1.0 - smoothstep(-0.2, -0.08, sun_direction.z));
        float disk = 1.0 - smoothstep(MOON_RADIUS - edge, MOON_RADIUS + edge, from_key);
        float maria = 0.72 + 0.5 * noise_at((direction.xy - key_direction.xy) * 9.0, 0.02).r;
        beyond = dark * mix(stars(direction) * max(1.0 - 1.3 * cloudiness(), 0.0), vec3(0.28, 0.27, 0.24) * maria, disk);
    }
    float from_sun = length(direction - sun_direction.xyz);
    float disk = 1.0 - smoothstep(SUN_RADIUS - edge, SUN_RADIUS + edge, from_sun);
    float glare = 2.5e-4 / (from_sun * from_sun + 2.5e-4);
    beyond += cloud_light.rgb * (12.0 * disk + 0.5 * glare * glare);
    shaded = developed(sky.rgb + beyond * sky.a);
}
