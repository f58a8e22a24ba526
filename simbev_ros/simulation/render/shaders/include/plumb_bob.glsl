// The lens of a camera that distorts: depth, and pixels of directions.
#include "flow"
uniform sampler2D lens_rays;   // x and y of the pixels' rays where z is 1
uniform vec4 lens_intrinsics;  // fx, fy, cx, cy, pixels
uniform vec4 lens_radial;      // k1, k2, k3; x² + y² up to which the model is valid
uniform vec2 lens_tangential;  // p1, p2

vec3 lens_ray(ivec2 texel) { return vec3(texelFetch(lens_rays, texel, 0).xy, 1.0); }

float lens_depth(vec3 seen) { return seen.z; }

bool lens_sees(vec3 seen) {
    vec2 place = seen.xy / seen.z;
    return seen.z > NEAREST && dot(place, place) <= lens_radial.w;
}

vec2 lens_pixel(vec3 seen) {
    vec2 place = seen.xy / seen.z;
    float r2 = dot(place, place);
    float radial = 1.0 + r2 * (lens_radial.x + r2 * (lens_radial.y + r2 * lens_radial.z));
    vec2 bent = place * radial + 2.0 * place.x * place.y * lens_tangential + lens_tangential.yx * (r2 + 2.0 * place * place);
    return bent * lens_intrinsics.xy + lens_intrinsics.zw;
}
