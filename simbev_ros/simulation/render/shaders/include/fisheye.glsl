// The lens of a fisheye (foundation/geometry/fisheye.py), of which one face of a cube is drawn; directions are in its frame.
uniform sampler2D lens_rays;   // optical frame: unit vectors, zero outside the image circle; relative solid angle
uniform mat3 face_from_optical;
uniform vec4 lens_intrinsics;  // fx, fy, cx, cy, pixels
uniform vec4 lens_radial;      // k1, k2, k3, k4
uniform float max_angle;       // radians

bool in_circle(ivec2 texel) { return texelFetch(lens_rays, texel, 0).xyz != vec3(0.0); }

vec3 direction_of(ivec2 texel) { return face_from_optical * texelFetch(lens_rays, texel, 0).xyz; }

// Whether a pixel is drawn with this face; outside the image circle, it is drawn with every face.
bool in_face(ivec2 texel) {
    vec3 direction = direction_of(texel);
    return direction.z >= max(abs(direction.x), abs(direction.y));
}

// Ray of a pixel in the circle, z = 1.
vec3 lens_ray(ivec2 texel) {
    vec3 direction = direction_of(texel);
    return vec3(direction.xy / direction.z, 1.0);
}

float lens_depth(vec3 seen) { return length(seen); }

float angle_to_axis(vec3 optical) { return atan(length(optical.xy), optical.z); }

bool lens_sees(vec3 seen) { return angle_to_axis(seen * face_from_optical) <= max_angle; }

vec2 lens_pixel(vec3 seen) {
    vec3 optical = seen * face_from_optical;
    float angle = angle_to_axis(optical), square = angle * angle;
    float radius = angle * (1.0 + square * (lens_radial.x + square * (lens_radial.y + square * (lens_radial.z + square * lens_radial.w))));
    return optical.xy * (radius / max(length(optical.xy), 1e-12)) * lens_intrinsics.xy + lens_intrinsics.zw;
}
