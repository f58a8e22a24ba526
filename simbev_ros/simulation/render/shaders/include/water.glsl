// Water on horizontal ground: a film where it is wet, puddles in hollows, and rings where drops hit.

struct Water {
    float film;    // share of the surface under a film or a puddle
    float puddle;
};

// hollow: depth of the ground's hollows, 0 to 1.1 (deepest); wet: share of the rain's water there.
Water water_on(uint material, vec3 normal, float hollow, float wet) {
    float level = smoothstep(0.9, 0.99, normal.z) * (material == MATERIAL_GRASS || material == MATERIAL_CROP ? 0.3 : 1.0);
    float puddle = level * smoothstep(1.1 - 0.6 * puddles(), 1.2 - 0.6 * puddles(), hollow);
    return Water(max(wetness() * level, puddle) * wet, puddle * wet);
}

float roughness_under(Water water, float dry) { return mix(mix(dry, 0.35, water.film * 0.8), 0.03, water.puddle); }

const float RING_CELL = 0.3;    // meters
const float RINGS_PER_S = 1.6;

// Slope of the rings of one drop per cell; at a distance they blend together.
vec2 ring_slope(vec2 place, float size) {
    vec2 cell = floor(place / RING_CELL);
    float age = seconds() * RINGS_PER_S + random(cell + 512.0), drop = floor(age);
    age -= drop;
    vec2 middle = 0.3 + 0.4 * vec2(random(cell + drop * 3.0), random(cell - drop * 5.0 + 99.0));
    vec2 away = (place / RING_CELL - cell - middle) * RING_CELL;
    float radius = max(length(away), 1e-3), front = (radius - age * 0.09) / 0.012;
    float falls = step(random(cell + drop * 7.0 + 31.0), rain());
    float wave = front * exp2(-front * front) * (1.0 - age) * clamp(1.5 - size / 0.012, 0.0, 1.0);
    return away / radius * wave * falls * 0.5;
}
