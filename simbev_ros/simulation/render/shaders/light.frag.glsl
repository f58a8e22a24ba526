#version 330
// Light of an ideal camera's color image.
#include "film"
uniform sampler2D ideal_rgb;
out vec4 light;

void main() { light = vec4(light_of(texelFetch(ideal_rgb, ivec2(gl_FragCoord.xy), 0).rgb), 1.0); }
