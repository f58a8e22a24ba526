// The light of the moment, as render/light.py, shadows.py and lamp_field.py write it. Linear RGB.
layout(std140) uniform Light {
    vec4 key_direction;   // towards sun or moon; exposure
    vec4 key_light;       // irradiance / pi
    vec4 sun_direction;   // towards the sun; drift of the clouds
    vec4 zenith;          // radiance; cloudiness 0..1
    vec4 horizon;         // radiance; wetness 0..1
    vec4 glow;            // radiance around the sun; puddles 0..1
    vec4 sky_ambient;     // irradiance / pi from above
    vec4 ground_ambient;  // irradiance / pi from below
    vec4 fog;             // per metre, start in metres, falloff per metre of height
    vec4 noise_origin;    // the world's origin in the map, modulo 64 m; half width of the contact map, metres
    mat4 near_clip_from_world;
    mat4 far_clip_from_world;
    mat4 lamp_field_from_world;
};
float exposure() { return key_direction.w; }
float cloudiness() { return zenith.w; }
float wetness() { return horizon.w; }
float puddles() { return glow.w; }
