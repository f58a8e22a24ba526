#version 330
// Fills the G-buffer, with flow and labels, from the index of the triangle that a pixel shows.
#include "g_buffer"
#include "rigid"
#include "vertex_bits"
uniform usampler2D triangle_ids;  // triangle; an actor's first row, or a tile's index with the highest bit set
uniform sampler2D triangle_depth;
uniform usampler2D rigid_actors;
#include "tint"
layout(std430, binding = 0) readonly buffer StaticVertices { uint static_words[]; };
layout(std430, binding = 1) readonly buffer StaticTriangles { uint static_corners[]; };
layout(std430, binding = 2) readonly buffer TilePlaces { float tile_places[]; };
layout(std430, binding = 3) readonly buffer ActorVertices { uint actor_words[]; };
layout(std430, binding = 4) readonly buffer ActorTriangles { uint actor_corners[]; };

const uint STATIC = 0x80000000u;
const uint WORDS = 8u;  // size of a vertex in 32-bit words
const float OVERHANG = 0.05;  // tolerance as a share of a triangle's sides: vertices snap to a grid of 1/256 pixel

struct Corner {
    vec3 position;  // at rest
    vec2 uv;
    uvec3 bits;
};

Corner static_corner(uint index) {
    uint w = static_corners[index] * WORDS;
    vec3 position = uintBitsToFloat(uvec3(static_words[w], static_words[w + 1u], static_words[w + 2u]));
    vec2 uv = uintBitsToFloat(uvec2(static_words[w + 3u], static_words[w + 4u]));
    return Corner(position, uv, uvec3(static_words[w + 5u], static_words[w + 6u], static_words[w + 7u]));
}

Corner actor_corner(uint index) {
    uint w = actor_corners[index] * WORDS;
    vec3 position = uintBitsToFloat(uvec3(actor_words[w], actor_words[w + 1u], actor_words[w + 2u]));
    vec2 uv = uintBitsToFloat(uvec2(actor_words[w + 3u], actor_words[w + 4u]));
    return Corner(position, uv, uvec3(actor_words[w + 5u], actor_words[w + 6u], actor_words[w + 7u]));
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    if (texelFetch(triangle_depth, texel, 0).x == 1.0) {
        show_sky();
        return;
    }
    uvec2 id = texelFetch(triangle_ids, texel, 0).xy;
    Corner a, b, c;
    uint row = 0u;
    if ((id.y & STATIC) != 0u) {
        a = static_corner(3u * id.x), b = static_corner(3u * id.x + 1u), c = static_corner(3u * id.x + 2u);
        uint tile = 3u * (id.y & ~STATIC);
        vec3 place = vec3(tile_places[tile], tile_places[tile + 1u], tile_places[tile + 2u]);
        a.position += place, b.position += place, c.position += place;
    } else {
        a = actor_corner(3u * id.x), b = actor_corner(3u * id.x + 1u), c = actor_corner(3u * id.x + 2u);
        row = id.y + part_of(c.bits);
        a.position = world_from_rest(row, vec4(a.position, 1.0));
        b.position = world_from_rest(row, vec4(b.position, 1.0));
        c.position = world_from_rest(row, vec4(c.position, 1.0));
    }

    // Where the pixel's ray meets the triangle's plane, clamped to the neighborhood of the triangle.
    vec3 eye = world_from_optical[3].xyz, ray = mat3(world_from_optical) * optical_ray(vec2(texel));
    vec3 side_b = b.position - a.position, side_c = c.position - a.position, across = cross(side_b, side_c);
    vec3 from_a = eye + ray * (dot(across, a.position - eye) / dot(across, ray)) - a.position;
    vec2 share = vec2(dot(across, cross(from_a, side_c)), dot(across, cross(side_b, from_a))) / dot(across, across);
    share.x = clamp(share.x, -OVERHANG, 1.0 + OVERHANG);
    share.y = clamp(share.y, -OVERHANG, 1.0 + OVERHANG - share.x);
    vec3 place = a.position + share.x * side_b + share.y * side_c;
    vec3 weights = vec3(1.0 - share.x - share.y, share);

    vec3 normal = weights.x * unpack_normal(a.bits.x) + weights.y * unpack_normal(b.bits.x) + weights.z * unpack_normal(c.bits.x);
    if (row != 0u) normal = world_from_rest(row, vec4(normal, 0.0));
    uint material = c.bits.y >> 24u;
    if (dot(across, ray) > 0.0 && material != uint(MATERIAL_FOLIAGE)) normal = -normal;  // seen from behind
    uvec4 actor = texelFetch(rigid_actors, ivec2(row & 127u, row >> 7u), 0);
    uvec2 surface = surface_of(c.bits, row, tint_of(c.bits, row, actor.z));
    g_surface = uvec4(surface.x, pack_normal(normal), floatBitsToUint(weights.x * a.uv + weights.y * b.uv + weights.z * c.uv));
    g_depth = dot(place - eye, world_from_optical[2].xyz);
    g_color = color_of(surface.y);
    semantic = c.bits.z & 0xFFu;
    instance = actor.x;
    vec3 before = row == 0u ? place : previous_from_now(row, vec4(place, 1.0));
    flow = flow_of((previous_optical_from_world * vec4(before, 1.0)).xyz, false);
}
