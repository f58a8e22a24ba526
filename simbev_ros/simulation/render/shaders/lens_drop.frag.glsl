#version 330
// A drop on the lens refracts the image like a small lens of its own: upside down, darker at its rim.
uniform sampler2D shaded;  // a copy of the image
in vec2 v_place;
flat in vec4 v_middle;
out vec4 rgb;

const float VIEW = 5.0;  // field of view of the drop, in multiples of its radius

void main() {
    vec2 size = vec2(textureSize(shaded, 0));
    float distance2 = dot(v_place, v_place);
    vec2 seen = (v_middle.xy - v_place * (0.6 + 0.4 * distance2) * v_middle.z * VIEW) / size;
    vec2 blur = v_middle.z * 0.35 / size;
    vec3 color = vec3(0.0);
    for (int tap = 0; tap < 4; ++tap)
        color += 0.25 * textureLod(shaded, seen + blur * (vec2(tap & 1, tap >> 1) - 0.5), 0.0).rgb;
    color *= 1.0 - 0.45 * smoothstep(0.5, 1.0, distance2);
    color += 0.10 * (1.0 - smoothstep(0.0, 0.35, length(v_place - vec2(-0.25, -0.45))));
    rgb = vec4(color, v_middle.w * (1.0 - smoothstep(0.72, 1.0, distance2)) * 0.85);
}
