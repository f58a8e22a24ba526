#version 330
// Mean visibility of 4 x 4 texels at about the same depth, which removes the pattern of visibility.frag.
#include "log_depth"
uniform sampler2D noisy_visibility;

out vec4 smoothed;

float depth_at(ivec2 cell) { return log2_depth(texelFetch(noisy_visibility, cell, 0).zw); }

void main() {
    ivec2 cell = ivec2(gl_FragCoord.xy), last = textureSize(noisy_visibility, 0) - 1;
    vec4 center = texelFetch(noisy_visibility, cell, 0);
    float depth = log2_depth(center.zw);
#ifdef COMPUTED
    ivec2 first = cell & ~1, next = min(first + 1, last);
    vec2 slope = vec2(depth_at(ivec2(next.x, cell.y)) - depth_at(ivec2(first.x, cell.y)), depth_at(ivec2(cell.x, next.y)) - depth_at(ivec2(cell.x, first.y)));
#else
    vec2 slope = vec2(dFdx(depth), dFdy(depth));
#endif
    vec2 total = vec2(0.0);
    float weights = 0.0;
    for (int y = -2; y < 2; ++y)
        for (int x = -2; x < 2; ++x) {
            vec4 found = texelFetch(noisy_visibility, clamp(cell + ivec2(x, y), ivec2(0), last), 0);
            float weight = same_surface(log2_depth(found.zw) - depth, slope, vec2(x, y));
            total += weight * found.xy;
            weights += weight;
        }
    smoothed = vec4(total / weights, center.zw);
}
