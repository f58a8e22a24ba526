// The light of the frame, written by light.py, shadows.py, lamp_field.py, tunnel_map.py and sky_view.py of render/lighting. Linear RGB.
layout(std140) uniform Light {
    vec4 key_direction;   // toward sun or moon; exposure
    vec4 key_light;       // irradiance / pi; wind 0..1
    vec4 sun_direction;   // toward the sun; drift of the clouds
    vec4 air_light;       // radiance of haze and fog; cloudiness 0..1
    vec4 air_glow;        // added to it toward the sun; wetness 0..1
    vec4 cloud_light;     // irradiance / pi of the sun or moon on clouds; puddles 0..1
    vec4 sky_ambient;     // irradiance / pi from above; seconds of the scene
    vec4 ground_ambient;  // irradiance / pi from below; rain 0..1
    vec4 fog;             // per meter, start in meters, falloff per meter of height; haze per meter
    vec4 noise_origin;    // the world's origin in the map, modulo 64 m; half width of the contact map, meters
    vec4 strewn;          // snow, fallen leaves and flowers 0..1; fog 0..1
    mat4 near_clip_from_world;
    mat4 far_clip_from_world;
    mat4 lamp_field_from_world;
    vec4 tunnel_place;    // world to tunnel map: offset x, y, z of heights; scale
    vec4 tunnel_light;    // irradiance / pi below a lamp; meters from the ego in a tunnel to the portal, else 0
    vec4 sky_view_place;  // world to map of the open sky: offset x, y, z of heights; scale
};
float exposure() { return key_direction.w; }
float cloudiness() { return air_light.w; }
float wetness() { return air_glow.w; }
float puddles() { return cloud_light.w; }
float wind() { return key_light.w; }
float snow() { return strewn.x; }
float leaf_litter() { return strewn.y; }
float flowers() { return strewn.z; }
float foggy() { return strewn.w; }
float rain() { return ground_ambient.w; }
float seconds() { return sky_ambient.w; }
