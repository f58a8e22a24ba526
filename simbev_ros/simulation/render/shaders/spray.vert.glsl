#version 330
// A puff of spray behind a wheel (render/shading/spray.py).
#include "air"
#if LIT
#include "lamps"
#endif
#include "film"
in vec3 in_at;  // world
in float in_radius;
in float in_opacity;
in float in_seed;

out vec2 v_across;  // -1 to 1 from side to side
flat out vec4 v_color;
flat out vec3 v_puff;  // depth, radius, seed

const float NEAREST = 0.8;

void main() {
    vec3 away = in_at - world_from_optical[3].xyz;
    float range = max(length(away), 0.1), depth = dot(away, world_from_optical[2].xyz);
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    vec4 clip = clip_from_world * vec4(in_at, 1.0);
    vec2 size = in_radius * intrinsics.xy / viewport.xy * 2.0;

    vec3 light = sky_ambient.rgb * 0.62 + air_light.rgb * 0.15 + cloud_light.rgb * 0.12;
#if LIT
    light += lamp_light(in_at, vec3(0.0, 0.0, 1.0)) * 1.3;
#endif
    float clear = exp2(-fog_depth(world_from_optical[3].z, in_at.z, range) - range * fog.w);
    light = mix(air_radiance(away / range), light, clear);
    v_color = vec4(film(light * exposure() * viewport.w), in_opacity * clamp((depth - NEAREST) / 2.5, 0.0, 1.0) * wet_share(tunnel_at(in_at, vec3(0.0))));
    v_across = corner, v_puff = vec3(depth, in_radius, in_seed);
    gl_Position = depth > NEAREST ? vec4(clip.xy / clip.w + corner * size / depth, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
}
