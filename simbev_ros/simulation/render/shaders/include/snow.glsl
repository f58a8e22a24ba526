// Snow on surfaces of the static world that face up. Uses light.

// hollow: 0..1 noise, larger where snow lies longest; kept: share of the snow that stays on such a surface.
vec3 snowed(vec3 albedo, vec3 normal, float hollow, float kept) {
    float depth = snow() * kept * smoothstep(0.25, 0.6, normal.z);
    return mix(albedo, vec3(0.58, 0.61, 0.66) * (0.9 + 0.1 * hollow), depth * smoothstep(0.9 - depth, 1.15 - depth, hollow));
}
