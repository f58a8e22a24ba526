#version 330
// Matt things: brick, plaster, roofs, wood, rubber, plastic, leaves, bark, cloth, skin, hair, and reflective sheeting.
#include "enums"
#include "lighting"
#include "noise"

const vec2 BRICK_SIZE = vec2(0.25, 0.085);
const float SHEETING_GAIN = 30.0;

// Place on the coordinate plane that the surface faces most, so that noise is not stretched.
vec2 flat_place(vec3 position, vec3 facing) {
    vec2 upright = facing.x > facing.y ? position.yz : position.xz;
    return facing.z > max(facing.x, facing.y) ? position.xy : upright;
}

// Brightness of retroreflective sheeting: it sends the light of headlamps back to them, and to a camera near them.
float retroreflected(vec3 position, vec3 to_camera) {
    vec4 field = texture(head_field, (lamp_field_from_world * vec4(position, 1.0)).xy);
    float towards = dot(field.xy, normalize(to_camera.xy)) / max(field.z, 1e-4);
    return min(SHEETING_GAIN * field.z * smoothstep(0.95, 0.99, towards), 0.9);
}

void main() {
    Pixel p = this_pixel();
    vec4 coarse = noise_at(p.uv / 9.0, p.size / 9.0);
    vec4 fine = noise_at(p.uv / 0.8, p.size / 0.8);
    Surface s = surface_of(p);
    s.albedo *= 0.9 + 0.1 * coarse.r + 0.1 * (fine.g - 0.5);
    if (p.material == MATERIAL_BRICK) {
        vec2 place = p.uv / BRICK_SIZE;
        place.x += 0.5 * mod(floor(place.y), 2.0);
        vec2 to_joint = (0.5 - abs(fract(place) - 0.5)) * BRICK_SIZE;
        float joint = max(line_cover(to_joint.x, 0.006, p.size), line_cover(to_joint.y, 0.006, p.size));
        float tone = (random(floor(place)) - 0.5) * 0.4 * clamp(1.0 - p.size * 12.0, 0.0, 1.0);
        s.albedo = mix(s.albedo * (1.0 + tone), vec3(0.42, 0.39, 0.35), joint * 0.7);
    } else if (p.material == MATERIAL_FOLIAGE) {
        vec2 place = flat_place(p.position + noise_origin.xyz, abs(p.normal));
        vec4 clump = noise_at(place / 8.0, p.size / 8.0);
        vec4 leaf = noise_at(place / 2.6, p.size / 2.6);
        float depth = 0.55 * leaf.g + 0.45 * leaf.b;  // 0 between the leaves, 1 at their tips
        s.albedo *= (0.62 + 0.58 * smoothstep(0.15, 0.75, depth)) * (0.86 + 0.28 * clump.b);
        s.albedo *= vec3(0.86 + 0.26 * clump.a, 0.98, 0.9);
        s.normal = normalize(p.normal + (vec3(leaf.ba, leaf.g) - 0.5) * 0.9 + (clump.bar - 0.5) * 0.9);
        s.roughness = 1.0;
        s.specular = 0.0;
        s.translucency = 0.6;
    } else if (p.material == MATERIAL_BARK || p.material == MATERIAL_WOOD) {
        s.albedo *= 0.7 + 0.6 * noise_at(p.uv * vec2(3.0, 0.5), p.size * 3.0).b;
    } else if (p.material == MATERIAL_ROOF) {
        s.albedo *= 0.8 + 0.3 * coarse.b + 0.2 * (fine.g - 0.5);
    } else if (p.material == MATERIAL_PLATE && lamps_lit() > 0.0) {
        s.emission = s.albedo * retroreflected(p.position, p.to_camera);
    }
    s.albedo *= 1.0 - 0.25 * wetness() * max(p.normal.z, 0.0);
    shade(p, s);
}
