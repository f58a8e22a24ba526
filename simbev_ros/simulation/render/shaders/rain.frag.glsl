#version 330
// A streak of rain, hidden by nearer surfaces.
uniform sampler2D g_depth;
in vec2 v_across;
in float v_depth;
flat in vec4 v_color;
out vec4 shaded;

void main() {
    float clear = step(v_depth, texelFetch(g_depth, ivec2(gl_FragCoord.xy), 0).x);
    vec2 soft = 1.0 - v_across * v_across;
    shaded = vec4(v_color.rgb, v_color.a * clear * soft.x * min(soft.y * 2.0, 1.0));
}
