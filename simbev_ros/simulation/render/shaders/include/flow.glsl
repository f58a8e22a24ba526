// Optical flow of a pixel: from the previous image position of its surface point to the current one.
#include "view"

const float NEAREST = 1e-3;  // meters in front of the camera

// before: position of the point, or direction to it, in the previous camera's optical frame.
vec2 flow_of(vec3 before) {
    vec2 pixel_before = before.xy / before.z * intrinsics.xy + intrinsics.zw;
    vec2 unseen = vec2(uintBitsToFloat(0x7FC00000u));  // NaN
    vec2 moved = before.z < NEAREST ? unseen : floor(gl_FragCoord.xy) - pixel_before;
    return viewport.z == 0.0 ? vec2(0.0) : moved;
}
