#version 330
// The current sky as a map of the hemisphere: clear sky or overcast (render/lighting/light.py), clouds, haze and fog.
#include "air"
#include "dome"
#include "noise"
uniform sampler2D sky_table;  // radiance without the shapes of clouds
uniform float size;           // width of the map, pixels

out vec4 dome;  // radiance; share of the light from beyond that passes through

const int LAYERS = 5 + 2 * QUALITY;
const float CLOUD_SCALE = 0.26;     // periods of the noise per height of the cloud base
const float CLOUD_DEPTH = 0.30;     // thickness of a cumulus, in heights of the cloud base
const float HORIZON_HEIGHT = 0.07;  // clouds end there, because the Earth is round
const float BASE = 1100.0;          // meters
const float BEYOND = 15000.0;       // meters of fog in front of the sky

// Depth inside a cloud at a position of the cloud map; the share of positions above 0 is the cloudiness.
float cloud_field(vec2 place, float pixel_size) {
    float large = noise_at(place, pixel_size).r;
    vec4 small = noise_at(place * 4.7 + 0.37, pixel_size * 4.7);
    return 0.90 * large + 0.38 * small.b - 0.08 * small.g - 0.13 - 0.93 * (1.0 - cloudiness()) + 0.3 * smoothstep(0.75, 1.0, cloudiness());
}

float phase(float cosine, float forward) {
    float spread = 1.0 + forward * forward - 2.0 * forward * cosine;
    return (1.0 - forward * forward) * inversesqrt(spread) / spread;
}

void main() {
    vec3 direction = dome_direction(gl_FragCoord.xy / size);
    float up = direction.z, flatness = 1.0 / (up + HORIZON_HEIGHT);
    vec3 sky = textureLod(sky_table, gl_FragCoord.xy / size, 0.0).rgb;
    float to_key = dot(direction, key_direction.xyz);

    vec2 place = direction.xy * flatness * CLOUD_SCALE;
    float pixel_size = CLOUD_SCALE * flatness * flatness * (1.0 + 5.0 * up) / size;
    pixel_size = max(pixel_size, 0.5 * length(place) * CLOUD_DEPTH / float(LAYERS));  // no detail between layers
    vec2 drift = vec2(sun_direction.w);
    vec2 sunward = key_direction.xy / (key_direction.z + 0.25) * CLOUD_SCALE * 0.10;
    float sheltered = cloud_field(place * (1.0 + 0.3 * CLOUD_DEPTH) + drift + sunward, pixel_size);

    float grain = mix(0.5, random(floor(gl_FragCoord.xy)), 0.7);  // hides the layers
    vec3 cloud = vec3(0.0);
    float through = 1.0;
    float silver = 0.38 + 0.10 * phase(to_key, 0.55) + 0.035 * phase(to_key, 0.85);
    vec3 below = sky_ambient.rgb * (1.25 - 0.45 * clamp(sheltered, 0.0, 1.0));
    for (int layer = 0; layer < LAYERS; ++layer) {
        float height = (float(layer) + grain) / float(LAYERS);
        float inside = cloud_field(place * (1.0 + height * CLOUD_DEPTH) + drift, pixel_size) - 0.30 * height * height;
        float density = smoothstep(0.0, 0.20, inside);
        float dense = 1.0 - exp2(-density * 11.0 / float(LAYERS));
        float shade = exp2(-8.0 * max(sheltered + 0.08 - 0.34 * height, 0.0));
        float thick = exp2(-3.6 * max(inside, 0.0));
        vec3 light = cloud_light.rgb * silver * (0.06 + 0.94 * shade) + below * mix(0.40, 1.10, 0.65 * thick + 0.35 * height);
        cloud += through * dense * light;
        through *= 1.0 - dense;
    }
    float high = noise_at(place * vec2(0.23, 0.75) + drift * 0.6 + 0.71, pixel_size).r;
    float cirrus = smoothstep(0.35, 1.0, high) * smoothstep(0.0, 0.3, cloudiness()) * 0.32;
    sky = mix(sky, cloud_light.rgb * (0.16 + 0.03 * phase(to_key, 0.7)) + sky_ambient.rgb * 0.5, cirrus);
    float near = exp2(-fog.w * BASE * flatness) * smoothstep(0.0, 0.05, up);
    float covered = smoothstep(0.0, 0.06, cloudiness()) * near;
    sky = mix(sky, cloud + through * sky, covered);

    float clear_air = exp2(-fog_depth(1.6, 1.6 + up * BEYOND, BEYOND) - (fog.w - HAZE) * 300.0 / (up + 0.12));
    dome = vec4(mix(air_radiance(direction), sky, clear_air), mix(1.0, through, covered) * (1.0 - cirrus) * clear_air);
}
