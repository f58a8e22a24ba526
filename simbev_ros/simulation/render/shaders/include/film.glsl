// The response of the camera: filmic tone mapping (Narkowicz 2015) and a gamma of 2.2, and its inverse.
// A rational function of the square root of the light is within 0.2 gray levels of the formula, whose pow is far slower.
vec3 film(vec3 light) {
    vec3 root = sqrt(clamp(light, 0.0, 100.0));
    vec3 above = root * (root * (root * 17.38562 + 1.14626) + 0.683365);
    return min(above / (root * (root * (root * 17.18499 + 1.13318) + 1.896871) + 1.0), 1.0);
}

vec3 light_of(vec3 color) {
    vec3 filmic = pow(color, vec3(2.2));
    vec3 a = 2.51 - 2.43 * filmic, b = 0.59 * filmic - 0.03, c = 0.14 * filmic;
    return (b + sqrt(b * b + 4.0 * a * c)) / (2.0 * a);
}
