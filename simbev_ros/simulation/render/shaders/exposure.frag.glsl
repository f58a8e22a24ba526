#version 330
// Color image of rows that are exposed for some time: the mean light of what each pixel sees.
#define SMOOTH_STEPS 1
#include "moving"
#include "film"
uniform sampler2D g_light;
uniform sampler2D lens_rays;
uniform float time_per_row;
uniform float exposed_time;
out vec4 rgb;

const float SPACING_PX = 2.0;
const int MOST_SAMPLES = 24;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec2 place = texelFetch(lens_rays, texel, 0).xy;
    float middle = (float(texel.y) - 0.5 * float(textureSize(lens_rays, 0).y - 1)) * time_per_row;
    Motions motions = motions_around(place);
    int samples = clamp(int(ceil(motions.speed * exposed_time / SPACING_PX)), 1, MOST_SAMPLES);
    vec3 light = vec3(0.0);
    for (int k = 0; k < samples; ++k) {
        float time = middle + ((float(k) + 0.5) / float(samples) - 0.5) * exposed_time;
        vec2 seen = (ideal_pixel(surface_seen(place, motions, time)) + 0.5) / vec2(textureSize(g_light, 0));
        light += textureLod(g_light, seen, 0.0).rgb;
    }
    rgb = vec4(film(light / float(samples)), 1.0);
}
