#version 330
// Sky, sun or moon, clouds and stars.
#include "lighting"
#include "noise"

const float CLOUD_SCALE = 0.16;
const float SUN_RADIUS = 0.0075;  // radians; larger than life, as lenses show it

float cloud_thickness(vec2 place, float pixel_size) {
    float coarse = noise_at(place, pixel_size).r;
    float fine = noise_at(place * 5.3 + 0.37, pixel_size * 5.3).b;
    float cover = cloudiness();
    float shape = coarse * 0.78 + fine * 0.22;
    return clamp((shape - 1.02 + cover * 1.05) * 3.2, 0.0, 1.0) * smoothstep(0.0, 0.08, cover);
}

vec3 stars(vec3 direction) {
    vec2 grid = direction.xy / (1.0 + max(direction.z, 0.0)) * 260.0;
    vec2 cell = floor(grid);
    float pick = random(cell + 700.0);
    float near = length(fract(grid) - 0.3 - 0.4 * vec2(random(cell + 900.0), random(cell + 1300.0)));
    return vec3(step(0.975, pick) * smoothstep(0.28, 0.0, near) * (pick - 0.97) * 30.0);
}

void main() {
    vec3 direction = normalize(mat3(world_from_optical) * optical_ray(floor(gl_FragCoord.xy)));
    vec3 radiance = sky_radiance(direction);
    float height = max(direction.z, 0.0);

    float from_key = length(direction - key_direction.xyz);
    bool night = sun_direction.z < -0.1;
    vec3 disk = night ? vec3(0.28, 0.27, 0.24) : key_light.rgb * 12.0;
    float edge = 1.0 / intrinsics.x;
    radiance += disk * smoothstep(SUN_RADIUS + edge, SUN_RADIUS - edge, from_key);
    radiance += night ? stars(direction) * 0.12 * (1.0 - cloudiness()) : vec3(0.0);

    vec2 place = direction.xy / (height + 0.11) * CLOUD_SCALE + sun_direction.w;
    float pixel_size = CLOUD_SCALE / (intrinsics.x * (height + 0.11) * (height + 0.11));
    float thickness = cloud_thickness(place, pixel_size);
    vec2 sunward = key_direction.xy / (abs(key_direction.z) + 0.3) * 0.012;
    float shadowed = clamp(cloud_thickness(place + sunward, pixel_size) * 1.1, 0.0, 1.0);
    float around_sun = pow(max(dot(direction, key_direction.xyz), 0.0), 24.0);
    vec3 bright = sky_ambient.rgb * 1.15 + key_light.rgb * (0.27 + 0.5 * around_sun) + glow.rgb * 0.22;
    vec3 dark = sky_ambient.rgb * 0.72 + key_light.rgb * 0.05;
    float billow = 0.82 + 0.36 * noise_at(place * 2.1 + 0.6, pixel_size * 2.1).r;
    vec3 cloud = mix(bright, dark, shadowed * 0.85) * mix(1.0, billow, cloudiness());
    float shown = thickness * smoothstep(0.0, 0.14, direction.z) * mix(0.95, 0.75, cloudiness());
    radiance = mix(radiance, cloud, shown);

    float far = 4000.0 / (1.0 + height * 60.0);
    shaded = developed(through_air(radiance, -direction, direction * far, far * smoothstep(0.0, 0.02, fog.x)));
}
