#version 330
// Rays of a rolling shutter's pixels: where what a pixel's row saw at its own time is in the G-buffer.
#define SMOOTH_STEPS 2
#include "moving"
uniform sampler2D lens_rays;
uniform float time_per_row;
out vec2 place;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float time = (float(texel.y) - 0.5 * float(textureSize(lens_rays, 0).y - 1)) * time_per_row;
    vec2 ray = texelFetch(lens_rays, texel, 0).xy;
    place = surface_seen(ray, motions_around(ray), time);
}
