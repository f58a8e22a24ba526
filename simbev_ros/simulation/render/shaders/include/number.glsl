// License plates: every vehicle with a cabin has a unique number.
uniform usampler2D rigid_actors;

// 0123456789AHKLPX as dots, three per row, five rows from the top: one octal digit per row.
const uint GLYPHS[16] = uint[16](
    075557u, 026227u, 071747u, 071717u, 055711u, 074717u, 074757u, 071111u,
    075757u, 075717u, 025755u, 055755u, 055655u, 044447u, 075744u, 055255u);
const vec2 DOT = vec2(0.0135, 0.015);  // meters
const float PITCH = 4.4;               // dots from character to character
const float CHARACTERS = 7.0;

vec3 numbered(vec3 albedo, vec2 uv, uint row, float size) {
    uvec4 actor = texelFetch(rigid_actors, ivec2(int(row & 127u), int(row >> 7u)), 0);
    vec2 dot_at = uv / DOT + vec2(0.5 * PITCH * CHARACTERS - 1.7, 2.5);
    float character = clamp(floor(dot_at.x / PITCH), 0.0, CHARACTERS - 1.0);
    vec2 cell = floor(vec2(dot_at.x - character * PITCH, dot_at.y)), inside = clamp(cell, vec2(0.0), vec2(2.0, 4.0));
    uint glyph = GLYPHS[hash(uvec2(actor.x, uint(character))) & 15u];
    float inked = float(glyph >> uint(int(inside.y) * 3 + 2 - int(inside.x)) & 1u);
    inked = cell == inside ? mix(0.55, inked, seen_apart(DOT.x, size)) : 0.0;
    vec3 plate = uv.x < -0.215 ? vec3(0.02, 0.06, 0.30) : albedo * (1.0 - 0.93 * inked);
    return actor.w == 0u ? albedo : plate;
}
