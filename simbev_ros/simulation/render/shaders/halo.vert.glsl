#version 330
// The part of the image in which fog or rain around a lamp scatters its light to the camera (render/lighting/fog_glow.py).
#include "glare"
uniform float rain_depth;  // optical depth / ln 2 per meter of rain
in float in_beam;          // 0: no headlamp, 1: low beam, 2: high beam

flat out vec3 v_at;
flat out vec4 v_facing;  // 0 shines all around, 1 only ahead
flat out vec4 v_light;   // radiance per meter of air, times the square of the distance from the lamp; strength of the beam
flat out vec3 v_air;     // optical depth / ln 2 of fog and of rain per meter; radius of the visible halo, meters

const float RADIANCE_PER_CANDELA = 0.009;  // per m², in the unit of sky.yaml
const float LEAST = 0.012, LARGEST = 18.0;  // visible light; radius, meters
const float BEAM_MIDDLE = 16.0;  // meters ahead of a headlamp
const float SPREAD = 0.7;        // radius of the surroundings of a lamp that may hide it, meters

// From the smallest to the largest value of x / z in a sphere that lies before the camera.
vec2 extent(float x, float z, float radius) {
    float low = x - radius, high = x + radius;
    return vec2(low / (low > 0.0 ? z + radius : z - radius), high / (high > 0.0 ? z - radius : z + radius));
}

void main() {
    vec3 to_camera = world_from_optical[3].xyz - in_at;
    float distance = length(to_camera);
    float fog_here = fog.x * exp2(-max(in_at.z, FOG_FLOOR) * fog.z), depth = (fog_here + rain_depth) * 0.6931472;
    float strength = in_color.a * RADIANCE_PER_CANDELA * depth * 0.25;
    float shown = strength * 3.14 * exposure() * viewport.w * clear_share(distance, in_at.z);
    float reach = min(shown / LEAST, LARGEST), beam = clamp(reach * 0.5 - 1.5, 0.0, 1.0) * (in_beam > 1.5 ? 3.0 : in_beam);
    vec3 middle = in_at + (beam > 0.0 ? in_facing * BEAM_MIDDLE : vec3(0.0));
    float radius = beam > 0.0 ? max(reach, BEAM_MIDDLE + 3.0) : reach;
    vec3 optical = transpose(mat3(world_from_optical)) * (middle - world_from_optical[3].xyz);
    bool around = optical.z < 1.1 * radius;
    vec2 x = extent(optical.x, optical.z, radius), y = extent(optical.y, optical.z, radius);
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    vec2 pixel = intrinsics.zw + intrinsics.xy * vec2(mix(x.x, x.y, corner.x), mix(y.x, y.y, corner.y)) + 0.5;
    float seen = distance_ahead(in_at) > 0.5 ? seen_share(in_at, SPREAD) : 1.0;
    seen *= (1.0 - tunnel_at(in_at, vec3(0.0)).inside) * clamp(1.0 + 2.0 * optical.z / radius, 0.0, 1.0);  // fades behind the camera
    v_at = in_at;
    v_facing = vec4(in_facing, in_form.x);
    v_light = vec4(in_color.rgb * strength * seen, beam);
    v_air = vec3(fog_here, rain_depth, reach);
    gl_Position = reach > 0.4 && seen > 0.0 ? (around ? vec4(corner * 2.0 - 1.0, 0.0, 1.0) : clip_of(pixel)) : vec4(2.0, 2.0, 2.0, 1.0);
}
