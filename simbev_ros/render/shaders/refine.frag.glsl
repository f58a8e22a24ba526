#version 330
// The image at full size from one that was shaded at every SHADING_STEP-th pixel: each pixel mixes the shaded ones around
// that lie on its own surface. Where there are none it mixes all, which softens edges.
uniform sampler2D coarse_shaded;
uniform sampler2D g_depth;

out vec4 rgb;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy), cell = pixel / SHADING_STEP, last = textureSize(coarse_shaded, 0) - 1;
    vec2 between = vec2(pixel - cell * SHADING_STEP) / float(SHADING_STEP);
    float nearness = 1.0 / texelFetch(g_depth, pixel, 0).x;  // linear over a plane; 0 for the sky
    vec2 slope = vec2(dFdx(nearness), dFdy(nearness)) * float(SHADING_STEP);
    float sharpness = 16.0 / (nearness + 1e-5);
    vec3 total = vec3(0.0);
    float weights = 0.0;
    for (int tap = 0; tap < 4; ++tap) {
        vec2 corner = vec2(tap & 1, tap >> 1);
        ivec2 there = min(cell + ivec2(corner), last);
        float change = 1.0 / texelFetch(g_depth, there * SHADING_STEP, 0).x - nearness;
        float off = min(abs(change), abs(change - dot(slope, corner - between)));
        vec2 share = mix(1.0 - between, between, corner) + 0.02;
        float weight = share.x * share.y * max(1.0 - sharpness * off, 1e-3);
        total += weight * texelFetch(coarse_shaded, there, 0).rgb;
        weights += weight;
    }
    rgb = vec4(total / weights, 1.0);
}
