// License plates: every vehicle with a cabin has a number of its own, in the manner of one of several countries.
uniform usampler2D rigid_actors;

// 0123456789AHKLPX as dots, three per row, five rows from the top: one octal digit per row.
const uint GLYPHS[16] = uint[16](
    075557u, 026227u, 071747u, 071717u, 055711u, 074717u, 074757u, 071111u,
    075757u, 075717u, 025755u, 055755u, 055655u, 044447u, 075744u, 055255u);
const vec2 DOT = vec2(0.0135, 0.015);  // meters
const float PITCH = 4.4;               // dots from character to character
const float CHARACTERS = 7.0;

// Bits of the characters that are letters and of those that are left blank, and whether the plate is yellow and has a blue band.
struct Layout { uint letters, blank; bool yellow, band; };

Layout layout_of(uint kind) {
    if (kind < 8u) return Layout(0x43u, 0x04u, false, true);    // AB 123 C
    if (kind < 12u) return Layout(0x70u, 0x08u, false, true);   // 123 ABC
    if (kind < 14u) return Layout(0x73u, 0x00u, true, true);    // AB12CDE
    return Layout(0x07u, 0x00u, false, false);                  // ABC1234
}

vec3 numbered(vec3 albedo, vec2 uv, uint row, float size) {
    uvec4 actor = texelFetch(rigid_actors, ivec2(int(row & 127u), int(row >> 7u)), 0);
    vec2 dot_at = uv / DOT + vec2(0.5 * PITCH * CHARACTERS - 1.7, 2.5);
    float character = clamp(floor(dot_at.x / PITCH), 0.0, CHARACTERS - 1.0);
    vec2 cell = floor(vec2(dot_at.x - character * PITCH, dot_at.y)), inside = clamp(cell, vec2(0.0), vec2(2.0, 4.0));
    Layout plan = layout_of(hash(uvec2(actor.x, 99u)) & 15u);
    uint bit = 1u << uint(character), own = hash(uvec2(actor.x, uint(character))), glyph = GLYPHS[(plan.letters & bit) != 0u ? 10u + own % 6u : own % 10u];
    float inked = float(glyph >> uint(int(inside.y) * 3 + 2 - int(inside.x)) & 1u);
    inked = cell == inside && (plan.blank & bit) == 0u ? mix(0.55, inked, seen_apart(DOT.x, size)) : 0.0;
    vec3 sheet = plan.yellow ? albedo * vec3(1.0, 0.72, 0.05) : albedo;
    vec3 plate = plan.band && uv.x < -0.215 ? vec3(0.02, 0.06, 0.30) : sheet * (1.0 - 0.93 * inked);
    return actor.w == 0u ? albedo : plate;
}
