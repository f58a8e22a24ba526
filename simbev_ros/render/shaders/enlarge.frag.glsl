#version 330
// The image at full size, from one at every SHADING_STEP-th pixel.
uniform sampler2D coarse_rgb;
out vec4 rgb;

void main() {
    vec2 texel = floor(gl_FragCoord.xy) / float(SHADING_STEP) + 0.5;
    rgb = textureLod(coarse_rgb, texel / vec2(textureSize(coarse_rgb, 0)), 0.0);
}
