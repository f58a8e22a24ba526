// Optical flow of a pixel: from the previous image position of its surface point to the current one.
#include "view"
uniform sampler2D previous_depth;  // of this camera, at the pixels of its previous image

const float NEAREST = 1e-3;  // meters in front of the camera
const float DEPTH_TOLERANCE = 0.005, DEPTH_TOLERANCE_M = 0.05;  // relative, and in addition

const float ON_PIXEL = 0.01;  // distance from a pixel's center, in pixels, up to which only this pixel counts

// Whether a point was visible in the previous image, by its pixel and its depth there: inside the image, and not behind
// what the four pixels around it showed.
bool was_visible(vec2 pixel, float depth) {
    ivec2 size = textureSize(previous_depth, 0);
    if (any(lessThan(pixel, vec2(-0.5))) || any(greaterThanEqual(pixel, vec2(size) - 0.5))) return false;
    float enough = (depth - DEPTH_TOLERANCE_M) / (1.0 + DEPTH_TOLERANCE);
    ivec2 nearest = clamp(ivec2(round(pixel)), ivec2(0), size - 1);
    if (texelFetch(previous_depth, nearest, 0).x >= enough) return true;  // almost always
    ivec2 low = max(ivec2(floor(pixel + ON_PIXEL)), 0), high = min(ivec2(ceil(pixel - ON_PIXEL)), size - 1);
    for (int y = low.y; y <= high.y; ++y)
        for (int x = low.x; x <= high.x; ++x)
            if (texelFetch(previous_depth, ivec2(x, y), 0).x >= enough) return true;
    return false;
}

// before: position of the point in the previous camera's optical frame; of the sky, the direction to it.
vec2 flow_of(vec3 before, bool sky) {
    if (viewport.z == 0.0) return vec2(0.0);
    vec2 pixel_before = before.xy / before.z * intrinsics.xy + intrinsics.zw;
    float depth = sky ? uintBitsToFloat(0x7F800000u) : before.z;  // +inf
    bool seen = before.z > NEAREST && was_visible(pixel_before, depth);
    return seen ? floor(gl_FragCoord.xy) - pixel_before : vec2(uintBitsToFloat(0x7FC00000u));  // NaN
}
