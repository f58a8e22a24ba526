#version 330
// Smooths edges of the shaded image along their direction, based on luma (FXAA: Lottes 2009).
#if SHADING_STEP > 1
#define shaded coarse_shaded
#endif
uniform sampler2D shaded;
out vec4 rgb;

const float LEAST_CONTRAST = 0.04;
const float RELATIVE_CONTRAST = 0.10;
const float MAX_SPAN = 8.0;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 last = textureSize(shaded, 0) - 1;
    vec2 texel_size = 1.0 / vec2(last + 1);
    vec4 center = texelFetch(shaded, texel, 0);
    float nw = texelFetch(shaded, max(texel + ivec2(-1, -1), 0), 0).a;
    float ne = texelFetch(shaded, ivec2(min(texel.x + 1, last.x), max(texel.y - 1, 0)), 0).a;
    float sw = texelFetch(shaded, ivec2(max(texel.x - 1, 0), min(texel.y + 1, last.y)), 0).a;
    float se = texelFetch(shaded, min(texel + ivec2(1, 1), last), 0).a;
    float darkest = min(center.a, min(min(nw, ne), min(sw, se)));
    float brightest = max(center.a, max(max(nw, ne), max(sw, se)));
    float contrast = brightest - darkest;

    vec2 along = vec2((sw + se) - (nw + ne), (nw + sw) - (ne + se));
    float damping = max((nw + ne + sw + se) * 0.03125, 1.0 / 128.0);
    along = clamp(along / (min(abs(along.x), abs(along.y)) + damping), -MAX_SPAN, MAX_SPAN) * texel_size;

    vec2 place = (vec2(texel) + 0.5) * texel_size;
    bool flat_here = contrast < max(LEAST_CONTRAST, brightest * RELATIVE_CONTRAST);
#if QUALITY < 2
    vec4 mixed = 0.5 * (textureLod(shaded, place - along * 0.3, 0.0) + textureLod(shaded, place + along * 0.3, 0.0));
    rgb = flat_here ? center : mixed;
#else
    vec4 inner = 0.5 * (textureLod(shaded, place - along / 6.0, 0.0) + textureLod(shaded, place + along / 6.0, 0.0));
    vec4 outer = inner * 0.5 + 0.25 * (textureLod(shaded, place - along * 0.5, 0.0) + textureLod(shaded, place + along * 0.5, 0.0));
    bool too_far = outer.a < darkest || outer.a > brightest;
    rgb = flat_here ? center : too_far ? inner : outer;
#endif
}
