#version 330
// Writes each pixel's shading class as depth, so that the depth test passes only the pixels of a shader's class.
uniform sampler2D g_color;
uniform float layer_step;

out vec4 unused;

void main() {
    float shading_class = round(log2(texelFetch(g_color, ivec2(gl_FragCoord.xy) * SHADING_STEP, 0).a * 255.0));
    gl_FragDepth = (shading_class + 0.5) * layer_step;
    unused = vec4(0.0);
}
