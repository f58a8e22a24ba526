// Light of lamps, from their maps seen from above (render/lighting/lamp_field.py).
#include "light"
#include "tunnel"
uniform sampler2D street_field;
uniform sampler2D beam_field;
uniform sampler2D glow_field;

const vec3 STREET_COLOR = vec3(0.27, 0.20, 0.12);
const vec3 BEAM_COLOR = vec3(0.235, 0.228, 0.214);
const float BEAM_LIFT = 0.5;   // rough ground reflects more of a beam's grazing light than smooth ground
const float BEAM_STRAY = 0.03; // share of a beam above its edge
const float FINER = 160.0 / 48.0;

// Texture coordinates in a map of a fine square (left) and a coarse one (right); coarse: coordinates in the latter.
vec2 map_place(vec2 coarse) {
    vec2 fine = (coarse - 0.5) * FINER + 0.5;
    bool is_fine = max(abs(fine.x - 0.5), abs(fine.y - 0.5)) < 0.496;
    return vec2(0.5, 1.0) * (is_fine ? fine : coarse) + vec2(is_fine ? 0.0 : 0.5, 0.0);
}

vec2 coarse_place(vec3 position) { return (lamp_field_from_world * vec4(position, 1.0)).xy; }

// 1 between two heights below the lamp, 0 outside: lamps do not shine through the deck of a bridge.
float between(float below, float low, float high, float soft) {
    return clamp((below - low) / soft + 1.0, 0.0, 1.0) * clamp(high + 1.0 - below, 0.0, 1.0);
}

// Irradiance / pi.
vec3 lamp_light(vec3 position, vec3 normal) {
    vec2 coarse = coarse_place(position), place = map_place(coarse);
    vec4 street = texture(street_field, coarse), beam = texture(beam_field, place), glow = texture(glow_field, place);

    float street_weight = max(street.z, 1e-4);
    vec2 direction = street.xy / street_weight;
    vec3 to_street = vec3(direction, sqrt(max(1.0 - dot(direction, direction), 0.0)));
    float street_share = between(street.w / street_weight - position.z, 1.0, 12.5, 4.0);
    street_share *= max(dot(normal, to_street) * 0.85 + 0.15, 0.0);
#if TUNNELS
    street_share *= 1.0 - tunnel_at(position, normal).inside;
#endif

    float beam_weight = max(beam.z, 1e-4);
    float below_edge = beam.w / beam_weight - position.z;
    float beam_share = between(below_edge, 0.06, 4.5, 0.28) * (1.0 - BEAM_STRAY) + between(below_edge, -2.0, 4.5, 1.0) * BEAM_STRAY;
    beam_share *= max(dot(normal, vec3(beam.xy / beam_weight, BEAM_LIFT)) * 0.85 + 0.15, 0.0);

    float glow_below = glow.w / max(dot(glow.rgb, vec3(0.299, 0.587, 0.114)), 1e-5) - position.z;
    float glow_share = between(glow_below, -0.5, 6.2, 3.0);

    vec2 to_edge = 0.5 - abs(coarse - 0.5);
    float shown = clamp(min(to_edge.x, to_edge.y) * 16.0, 0.0, 1.0);
    return shown * (STREET_COLOR * street.z * street_share + BEAM_COLOR * beam.z * beam_share + glow.rgb * glow_share);
}
