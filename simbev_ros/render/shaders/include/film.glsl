// The response of the camera: filmic tone mapping (Narkowicz 2015) and sRGB, and its inverse.
vec3 film(vec3 light) {
    vec3 filmic = clamp(light * (2.51 * light + 0.03) / (light * (2.43 * light + 0.59) + 0.14), 0.0, 1.0);
    return pow(filmic, vec3(1.0 / 2.2));
}

vec3 light_of(vec3 color) {
    vec3 filmic = pow(color, vec3(2.2));
    vec3 a = 2.51 - 2.43 * filmic, b = 0.59 * filmic - 0.03, c = 0.14 * filmic;
    return (b + sqrt(b * b + 4.0 * a * c)) / (2.0 * a);
}
