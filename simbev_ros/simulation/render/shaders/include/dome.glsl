// Map of the sky's hemisphere, defined by `hemisphere_angles` of light.py; the horizon is its unit circle.
const float HORIZON_STRETCH = 0.5;

// Position 0..1 in the map of an upward direction.
vec2 dome_place(vec3 direction) {
    float up = max(direction.z, 0.0);
    return 0.5 + direction.xy * (0.5 * HORIZON_STRETCH / (HORIZON_STRETCH + up));
}

vec3 dome_direction(vec2 place) {
    const float s = HORIZON_STRETCH;
    vec2 from_zenith = place * 2.0 - 1.0;
    float radius2 = dot(from_zenith, from_zenith);
    from_zenith *= radius2 > 1.0 ? inversesqrt(radius2) : 1.0;
    radius2 = min(radius2, 1.0);
    float up = s * (sqrt(radius2 * (1.0 - s * s) + s * s) - radius2) / (radius2 + s * s);
    return vec3(from_zenith * ((s + up) / s), up);
}
