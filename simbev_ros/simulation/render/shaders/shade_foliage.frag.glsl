#version 330
// Leaves, needles and hedges.
#include "enums"
#include "lighting"
#include "noise"
#include "snow"

// Position on the coordinate plane that is most parallel to the surface, so that noise is not stretched.
vec2 flat_place(vec3 position, vec3 facing) {
    vec2 upright = facing.x > facing.y ? position.yz : position.xz;
    return facing.z > max(facing.x, facing.y) ? position.xy : upright;
}

const float GUST = 0.22;  // displacement of leaves in a storm, meters

void main() {
    Pixel p = this_pixel();
    vec2 place = flat_place(p.position + noise_origin.xyz, abs(p.normal));
    vec2 gust = abs(fract(seconds() * vec2(0.83, 1.27) + place.yx * vec2(0.31, 0.23)) * 2.0 - 1.0);
    place += wind() * GUST * gust;
    vec4 leaf = texture_at(place, 2.6, p.size);
#if QUALITY >= 1
    vec4 clump = texture_at(place, 8.0, p.size);
#else
    vec4 clump = leaf.abgr;
#endif
    Surface s = surface_of(p);
    float depth = 0.55 * leaf.g + 0.45 * leaf.b;  // 0 between the leaves, 1 at their tips
    s.albedo *= (0.62 + 0.58 * smoothstep(0.15, 0.75, depth)) * (0.86 + 0.28 * clump.b);
    s.albedo *= vec3(0.86 + 0.26 * clump.a, 0.98, 0.9);
    s.normal = normalize(p.normal + (vec3(leaf.ba, leaf.g) - 0.5) * 0.9 + (clump.bar - 0.5) * 0.9);
    s.albedo = snowed(s.albedo, s.normal, 0.5 * leaf.g + 0.5 * clump.b, 0.75);
    s.albedo *= 1.0 - 0.25 * wetness() * max(s.normal.z, 0.0);
    s.roughness = 1.0;
    s.metallic = 0.0;  // no reflections, so none are computed
    s.specular = 0.0;
    s.translucency = 0.6;
    shade(p, s);
}
