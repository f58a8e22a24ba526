#version 330
// Area where a wet road may reflect a lamp: from below it toward the camera.
#include "glare"

out vec3 v_across;  // -1 to 1 from side to side, times the width; down from 0 to 1; width
flat out vec3 v_lamp;
flat out vec3 v_light;
flat out vec4 v_facing;

const float LEAST_LUX = 0.008;
const float FOREMOST = 2.5;  // in multiples of the camera's height

void main() {
    vec3 camera = world_from_optical[3].xyz;
    vec3 foot = in_at - vec3(0.0, 0.0, in_form.y);
    float height = camera.z - foot.z;
    vec2 away = foot.xy - camera.xy;
    float distance = length(away);
    vec3 near = vec3(camera.xy + away * min(FOREMOST * height / max(distance, 0.1), 0.7), foot.z);
    bool drawn = in_color.a > LEAST_LUX * distance * distance && height > 0.3 && distance > 2.0 && min(distance_ahead(foot), distance_ahead(near)) > 0.3;
    vec2 top = pixel_of(foot), bottom = pixel_of(near);
    vec2 down = normalize(bottom - top + vec2(0.0, 1e-3)), side = vec2(down.y, -down.x);
    bool is_top = gl_VertexID >> 1 == 0;
    float width = is_top ? 0.35 * intrinsics.x * height / distance + 4.0 : 0.3 * intrinsics.x * height / max(length(near.xy - camera.xy), 0.1);
    vec2 place = (is_top ? top : bottom) + side * width * (float(gl_VertexID & 1) * 2.0 - 1.0);
    v_across = vec3((float(gl_VertexID & 1) * 2.0 - 1.0) * width, is_top ? 0.0 : 1.0, width);
    float seen = drawn ? seen_share(in_at, LAMP) * wet_share(tunnel_at(foot, vec3(0.0))) : 0.0;
    v_lamp = in_at;
    v_light = in_color.rgb * in_color.a * seen * wetness() * clear_share(distance, foot.z);
    v_facing = vec4(in_facing, in_form.x);
    gl_Position = seen > 0.0 ? clip_of(place) : vec4(2.0, 2.0, 2.0, 1.0);
}
