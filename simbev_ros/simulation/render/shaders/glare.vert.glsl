#version 330
// A lamp's bright point, at least one pixel large, and its glare in the lens.
#include "glare"

out vec2 v_offset;        // pixels from the lamp
out vec2 v_corner;        // the same, scaled to 1 where the glare ends
flat out vec3 v_color;
flat out vec4 v_strength; // strength of the point, of the glare; radius of each, pixels

const float LEAST = 0.015;
const float GLARE_ANGLE = 0.0044;
const float LARGEST = 0.16;  // maximum radius, as a share of the image's width

void main() {
    vec3 to_camera = world_from_optical[3].xyz - in_at;
    float distance = max(length(to_camera), 2.0), focal = intrinsics.x;
    float clear = clear_share(distance, in_at.z);
    float lux = in_color.a * sent_to(to_camera) / (distance * distance);
    float shown = exposure() * viewport.w / USUAL_EXPOSURE * clear;
    shown *= distance_ahead(in_at) > 0.3 ? seen_share(in_at, LAMP) : 0.0;
    float lamp_px = 0.09 * focal / distance;
    float point = 38.0 * pow(lux, 0.7) * shown * (1.0 - smoothstep(2.0, 6.0, lamp_px));
    float glare = 2.4 * pow(lux, 0.6) * shown;
    float spread = focal * GLARE_ANGLE * (1.0 + 0.7 * wetness() + 7.0 * (1.0 - clear)) + lamp_px;
    float ends = spread * sqrt(max(pow(max(glare, LEAST) / LEAST, 0.6667) - 1.0, 0.0));
    float core = max(0.5 * lamp_px, 0.9);
    float half_px = min(max(ends, core * sqrt(log2(max(point, LEAST) / LEAST))), LARGEST * viewport.x);
    half_px = max(point, glare) < LEAST ? 0.0 : half_px;

    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    v_offset = corner * half_px;
    v_corner = corner;
    v_color = in_color.rgb + 0.03;
    v_strength = vec4(point, glare, core, spread);
    gl_Position = half_px > 0.0 ? clip_of(pixel_of(in_at) + v_offset) : vec4(2.0, 2.0, 2.0, 1.0);
}
