// Optical flow of a pixel: from where its surface point was in the previous frame to here.
#include "view"

const float NEAREST = 1e-3;  // metres before the camera

// before: of the point, or of the direction to it, in the previous camera's optical frame.
vec2 flow_of(vec3 before) {
    vec2 pixel_before = before.xy / before.z * intrinsics.xy + intrinsics.zw;
    vec2 unseen = vec2(uintBitsToFloat(0x7FC00000u));  // NaN
    vec2 moved = before.z < NEAREST ? unseen : floor(gl_FragCoord.xy) - pixel_before;
    return viewport.z == 0.0 ? vec2(0.0) : moved;
}
