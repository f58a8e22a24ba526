#version 330
// One streak of rain (render/shading/rain.py): a drop's path relative to the camera while the shutter is open.
#include "air"
#if LIT
#include "lamps"
#endif
#include "film"
uniform vec3 box;         // meters; period of the drops
uniform vec3 shift[4];    // displacement of the drops of each speed, world
uniform vec3 passing[4];  // path past the camera of the drops of each speed, meters

out vec2 v_across;  // -1 to 1 from side to side, and from end to end
out float v_depth;
flat out vec4 v_color;

const float DROP = 0.0030;  // width in meters; larger than real, to stand for the drops that are not drawn
const float STREAK = 0.55;  // opacity of a streak that fills its pixels
const float NEAREST = 0.6;

uvec3 words(uint number) {
    uvec3 bits = uvec3(number, number ^ 0x9E3779B9u, number + 0x7F4A7C15u) * 0x85EBCA6Bu;
    bits = (bits ^ bits >> 16u) * 0xC2B2AE35u;
    bits += bits.yzx * 1664525u;
    return (bits ^ bits >> 15u) * 0x2C1B3C6Du;
}

void main() {
    vec3 share = vec3(words(uint(gl_InstanceID)) >> 8u) / 16777216.0;
    int speed = gl_InstanceID & 3;
    vec3 camera = world_from_optical[3].xyz;
    vec3 from_camera = mod(share * box + shift[speed] - camera + 0.5 * box, box) - 0.5 * box;
    vec4 head = clip_from_world * vec4(camera + from_camera, 1.0);
    vec4 tail = clip_from_world * vec4(camera + from_camera - passing[speed], 1.0);

    vec2 head_px = head.xy / head.w * 0.5 * viewport.xy, tail_px = tail.xy / tail.w * 0.5 * viewport.xy;
    vec2 along = head_px - tail_px;
    float length_px = max(length(along), 1e-3), focal = intrinsics.x;
    along /= length_px;
    float width_px = DROP * focal / head.w, half_px = 0.5 * max(width_px, 1.0);
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    vec2 place = (corner.y > 0.0 ? head_px : tail_px) + along * corner.y * 0.5 + vec2(along.y, -along.x) * corner.x * (half_px + 0.5);

    vec3 edge = abs(from_camera) / (0.5 * box);
    float inside = 1.0 - smoothstep(0.75, 1.0, max(edge.x, edge.y));
    vec3 light = sky_ambient.rgb * 0.62 + air_light.rgb * 0.25;
#if LIT
    light += lamp_light(camera + from_camera, vec3(0.0, 0.0, 1.0)) * 2.0;
#endif
    v_color = vec4(film(light * exposure() * viewport.w), STREAK * inside * min(width_px, 1.0) * min(1.0, 90.0 / length_px));
    v_across = corner;
    v_depth = 0.5 * (head.w + tail.w);
    bool drawn = min(head.w, tail.w) > NEAREST && tunnel_at(camera + from_camera, vec3(0.0)).inside == 0.0;
    gl_Position = drawn ? vec4(place / viewport.xy * 2.0, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
}
