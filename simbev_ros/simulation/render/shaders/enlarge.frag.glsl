#version 330
// Upscales the image from every SHADING_STEP-th pixel to full size.
uniform sampler2D coarse_rgb;
out vec4 rgb;

void main() {
    vec2 texel = floor(gl_FragCoord.xy) / float(SHADING_STEP) + 0.5;
    rgb = textureLod(coarse_rgb, texel / vec2(textureSize(coarse_rgb, 0)), 0.0);
}
