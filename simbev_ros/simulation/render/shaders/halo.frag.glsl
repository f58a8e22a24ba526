#version 330
// Light of a lamp that air in front of the visible surface scatters once to the camera (Sun et al. 2005). The path is sampled
// at angles around the lamp (Kulla and Fajardo 2012), those of Gauss and Legendre: this divides out the square of the distance.
#include "view"
#include "light"
uniform sampler2D g_depth;
flat in vec3 v_at;
flat in vec4 v_facing;
flat in vec4 v_light;
flat in vec3 v_air;
out vec4 added;

const float OUTER = 0.112702;     // first of three nodes in a unit interval; the second one is its middle
const vec2 WEIGHTS = vec2(0.277778, 0.444444);
const float SOFT2 = 0.02;         // square of a lamp's radius, m²
const float FORWARD = 0.6;        // asymmetry of scattering by droplets, lower than real as light is scattered several times
const float BEAM_GAIN = 9.0;      // intensity in the middle of a headlamp's beam, in multiples of that of its glare
const float BEAM_SHARPNESS = 70.0, BEAM_COSINE2 = 0.90;  // the latter at the edge of the beam

// Path through the air from the camera: direction, and where it passes the lamp.
struct Path { vec3 direction; float nearest; float apart; };

float phase(float cosine) { return (1.0 - FORWARD * FORWARD) * pow(1.0 + FORWARD * FORWARD - 2.0 * FORWARD * cosine, -1.5); }

float sent(vec3 direction, bool beam) {
    float ahead = max(dot(v_facing.xyz, direction), 0.0);
    if (!beam) return mix(1.0, ahead * ahead, v_facing.w);
    float below = clamp(0.5 - (direction.z - v_facing.z) * 40.0, 0.03, 1.0);
    return BEAM_GAIN * exp2((ahead - 1.0) * BEAM_SHARPNESS) * v_light.w * (v_light.w > 1.5 ? 1.0 : below);
}

// Share of the lamp's light that is scattered between two distances from the camera.
float scattered(Path path, float start, float end, bool beam) {
    float from = (start - path.nearest) / path.apart, to = (end - path.nearest) / path.apart, total = 0.0;
    float angle = atan(max(to - from, 0.0), 1.0 + from * to);
    float first = tan(angle * OUTER), step = tan(angle * (0.5 - OUTER));
    vec2 at = vec2(from + first, 1.0 - from * first);  // tangent of an angle, as a fraction
    for (int k = 0; k < 3; ++k) {
        float range = path.nearest + path.apart * at.x / at.y;
        at = vec2(at.x + at.y * step, at.y - at.x * step);
        vec3 from_lamp = world_from_optical[3].xyz + path.direction * range - v_at;
        float away = length(from_lamp);
        from_lamp /= max(away, 0.1);
        float fogged = max(range - fog.y, 0.0), in_fog = fogged > 0.0 ? 1.0 : v_air.y / (v_air.x + v_air.y + 1e-6);
        float clear = exp2(-v_air.x * (fogged + away) - v_air.y * (range + away));
        total += (k == 1 ? WEIGHTS.y : WEIGHTS.x) * sent(from_lamp, beam) * phase(-dot(from_lamp, path.direction)) * clear * in_fog;
    }
    return total * angle / path.apart;
}

// Distances from the camera between which a path is inside the cone of a headlamp.
vec2 in_beam(Path path, float end) {
    vec3 from_lamp = world_from_optical[3].xyz - v_at;
    float along = dot(path.direction, v_facing.xyz), before = dot(from_lamp, v_facing.xyz);
    float a = along * along - BEAM_COSINE2, b = along * before - BEAM_COSINE2 * dot(path.direction, from_lamp);
    float c = before * before - BEAM_COSINE2 * dot(from_lamp, from_lamp), root2 = b * b - a * c;
    float root = sqrt(max(root2, 0.0)), low = min((-b - root) / a, (-b + root) / a), high = max((-b - root) / a, (-b + root) / a);
    vec2 range = a < 0.0 ? vec2(low, high) : root2 < 0.0 ? vec2(0.0, end) : along > 0.0 ? vec2(high, end) : vec2(0.0, low);
    range = clamp(a < 0.0 && root2 < 0.0 ? vec2(0.0) : range, 0.0, end);
    return before + 0.5 * (range.x + range.y) * along > 0.0 ? range : vec2(0.0);
}

void main() {
    vec2 pixel = min(floor(gl_FragCoord.xy) * float(GLOW_STEP), viewport.xy - 1.0);
    vec3 ray = mat3(world_from_optical) * optical_ray(pixel), to_lamp = v_at - world_from_optical[3].xyz;
    float stretch = length(ray), end = min(texelFetch(g_depth, ivec2(pixel), 0).x * stretch, 400.0);
    Path path = Path(ray / stretch, dot(to_lamp, ray) / stretch, 0.0);
    float apart2 = max(dot(to_lamp, to_lamp) - path.nearest * path.nearest, 0.0) + SOFT2;
    path.apart = sqrt(apart2);
    float window = max(1.0 - apart2 / (v_air.z * v_air.z), 0.0), share = 0.0;
    if (window > 0.0) share = window * scattered(path, 0.0, end, false);
    if (v_light.w > 0.0) {
        vec2 lit = in_beam(path, end);
        if (lit.y > lit.x) share += scattered(path, lit.x, lit.y, true);
    }
    vec3 color = 1.0 - exp2(-v_light.rgb * (share * exposure() * viewport.w));
    added = vec4(color, dot(color, vec3(0.299, 0.587, 0.114)));
}
