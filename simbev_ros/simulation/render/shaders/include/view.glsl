// One camera in the current and in the previous frame. World: map axes, relative to the frame's origin.
layout(std140) uniform View {
    mat4 clip_from_world;
    mat4 world_from_optical;
    mat4 previous_optical_from_world;
    vec4 intrinsics;  // fx, fy, cx, cy, pixels
    vec4 viewport;    // width, height, pixels; 1 if there is a previous frame; exposure gain
};

// Ray through a pixel's center, z = 1, optical frame. Row 0 of a framebuffer is the image's top row.
vec3 optical_ray(vec2 pixel) { return vec3((pixel - intrinsics.zw) / intrinsics.xy, 1.0); }
