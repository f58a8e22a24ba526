#version 330
// A raindrop on the lens: it lands, stays, slides down a little and vanishes (render/shading/rain.py).
#include "view"
#include "random_words"
uniform float time;        // seconds
uniform uint camera_seed;

out vec2 v_place;          // position in the drop, its rim at 1
flat out vec4 v_middle;    // center, pixels; radius, pixels; opacity

uvec4 words(uvec2 seed) { return random_words(uvec4(seed, seed.x ^ seed.y, seed.x + seed.y * 0x9E3779B9u)); }

void main() {
    uint number = uint(gl_InstanceID) + camera_seed * 64u;
    float period = 3.0 + 7.0 * float(words(uvec2(number, 1u)).x >> 8u) / 16777216.0;
    float age = time / period + float(words(uvec2(number, 2u)).x >> 8u) / 16777216.0;
    vec4 share = vec4(words(uvec2(number, 3u + uint(floor(age)))) >> 8u) / 16777216.0;
    age = fract(age);
    float radius = viewport.y * mix(0.006, 0.022, share.z * share.z);
    float slide = max(age - 0.5, 0.0) * share.z * share.z * 0.35;
    vec2 middle = viewport.xy * vec2(share.x, share.y + slide);
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    v_place = corner * 1.1;
    v_middle = vec4(middle, radius, smoothstep(0.0, 0.02, age) * (1.0 - smoothstep(0.7, 1.0, age)));
    gl_Position = vec4((middle + v_place * radius * vec2(1.0, 1.15)) / viewport.xy * 2.0 - 1.0, 0.0, 1.0);
}
