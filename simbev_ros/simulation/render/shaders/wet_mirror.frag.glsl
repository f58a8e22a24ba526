#version 330
// Screen-space reflections on wet ground: cars, houses and lamps replace the sky that its shader assumed.
#include "enums"
#include "pixel"
#include "sky"
#include "noise"
#include "water"
uniform sampler2D ideal_rgb;  // a copy of the shaded image
out vec4 shaded;

const int STEPS = QUALITY == 2 ? 16 : 9;
const int REFINEMENTS = 2 + QUALITY / 2;
const float FIRST = QUALITY == 2 ? 0.3 : 0.5;     // meters
const float GROWTH = QUALITY == 2 ? 1.38 : 1.8;
const float THICKNESS = QUALITY == 2 ? 0.45 : 0.8;  // assumed thickness of objects, as a share of the range
const float GRAIN = 0.045;    // slope of wet asphalt
const vec3 LUMA = vec3(0.299, 0.587, 0.114);

// Homogeneous pixel coordinates, and depth.
vec3 pixels_of(vec4 clip) { return vec3((clip.xy + clip.w) * 0.5 * viewport.xy, clip.w); }

// Tone mapping of film.glsl before its gamma, which is taken as 2 here.
vec3 filmic(vec3 light) { return clamp(light * (2.51 * light + 0.03) / (light * (2.43 * light + 0.59) + 0.14), 0.0, 1.0); }

float depth_at(vec3 pixels) { return texelFetch(g_depth, ivec2(clamp(pixels.xy / pixels.z, vec2(0.0), viewport.xy - 1.0)), 0).x; }

void main() {
    Pixel p = this_pixel();
    vec4 coarse = texture_at(p.uv / 37.0, p.size / 37.0), middle = texture_at(p.uv.yx / 5.3, p.size / 5.3);
    Water water = water_on(p.material, p.normal, coarse.a * 0.7 + middle.r * 0.4, wet_share(tunnel_at(p.position, p.normal)));
    vec2 slope = (noise_at(p.uv / 0.4, p.size / 0.4).ba - 0.5) * GRAIN * (1.0 - water.puddle) + ring_slope(p.uv, p.size) * water.film;
    vec3 normal = normalize(p.normal + vec3(slope, 0.0));
    vec3 direction = reflect(-p.to_camera, normal);
    direction.z = max(direction.z, 0.01);

    vec3 start = pixels_of(clip_from_world * vec4(p.position + p.normal * 0.02, 1.0));
    vec3 way = pixels_of(clip_from_world * vec4(direction, 0.0));
    float before = 0.0, after = 0.0, found = 0.0, range = FIRST;
    for (int leap = 0; leap < STEPS; ++leap) {
        vec3 at = start + way * range;
        float behind = at.z - depth_at(at);
        bool hit = found == 0.0 && at.z > 0.1 && behind > 0.0 && behind < 0.5 + THICKNESS * range;
        found = hit ? 1.0 : found;
        after = hit ? range : after;
        before = found > 0.0 ? before : range;
        range *= GROWTH;
    }
    for (int turn = 0; turn < REFINEMENTS; ++turn) {
        float middle_range = 0.5 * (before + after);
        vec3 at = start + way * middle_range;
        bool hit = at.z > depth_at(at);
        after = hit ? middle_range : after;
        before = hit ? before : middle_range;
    }
    vec3 end = start + way * after;
    vec2 pixel = clamp(end.xy / end.z, vec2(0.0), viewport.xy - 1.0), to_edge = 0.5 - abs(pixel / viewport.xy - 0.5);
    found *= clamp(min(to_edge.x, to_edge.y) * 12.0, 0.0, 1.0);
    vec3 mirrored = texelFetch(ideal_rgb, ivec2(pixel), 0).rgb;

    float roughness = roughness_under(water, materials[p.material].x);
    float specular = mix(materials[p.material].z, 0.03, water.film);
    float grazing = 1.0 - max(dot(normal, p.to_camera), 0.0), grazing2 = grazing * grazing;
    float fresnel = specular + max(1.0 - roughness - specular, 0.0) * grazing2 * grazing2 * grazing;
    vec3 instead = mirrored * mirrored - filmic(surroundings(direction, roughness) * (exposure() * viewport.w));
    float range_here = dot(world_from_optical[3].xyz - p.position, p.to_camera);
    float clear = exp2(-fog_depth(world_from_optical[3].z, p.position.z, range_here) - range_here * fog.w);
    vec3 own = texelFetch(ideal_rgb, ivec2(gl_FragCoord.xy), 0).rgb;
    vec3 light = own * own + instead * (fresnel * (1.0 - 0.7 * roughness) * found * clear * water.film);
    vec3 color = sqrt(clamp(light, 0.0, 1.0));
    shaded = vec4(color, dot(color, LUMA));
}
