// The air between camera and surfaces: haze, fog that thins out with height, the veil of rain.
#include "light"
#include "view"
#include "tunnel"
const float FROM_ABOVE = 0.45;  // increase of the radiance of fog from the horizon to the zenith, as light enters it from above
const float FOG_FLOOR = -30.0;  // meters; below this height, the fog density is constant

// Optical depth / ln 2 of fog on a straight path between two heights in the world.
float fog_depth(float from_height, float to_height, float range) {
    float in_fog = max(range - fog.y, 0.0);
    float end = max(to_height, FOG_FLOOR), start = max(mix(to_height, from_height, in_fog / range), FOG_FLOOR);
    float start_density = exp2(-start * fog.z), end_density = exp2(-end * fog.z);
    float fall = (end - start) * fog.z * 0.6931472;
    float mean = abs(fall) > 1e-2 ? (start_density - end_density) / fall : 0.5 * (start_density + end_density);
    return fog.x * in_fog * mean;
}

// Radiance of air that scatters the light of sky and sun into a ray along a direction.
vec3 air_radiance(vec3 direction) {
    float towards = max(dot(direction, sun_direction.xyz) * 0.5 + 0.5, 0.0);
    towards *= towards;
    towards *= towards;
    float from_above = 1.0 + foggy() * FROM_ABOVE * clamp(direction.z, -0.35, 0.7);
    return (air_light.rgb + air_glow.rgb * towards * towards) * from_above;
}

// Radiance of a surface point after passing through the air to the camera.
vec3 through_air(vec3 radiance, vec3 to_camera, vec3 position) {
    float range = dot(world_from_optical[3].xyz - position, to_camera);
    float depth = fog_depth(world_from_optical[3].z, position.z, range) + range * fog.w;
#if TUNNELS
    Tunnel tunnel = tunnel_at(position, to_camera);
    bool is_same = tunnel.inside * tunnel_light.w > 0.0;
    depth *= is_same ? 0.0 : clamp(1.0 - (tunnel.inside * tunnel.depth + tunnel_light.w) / max(range, 1.0), 0.0, 1.0);
#endif
    return mix(air_radiance(-to_camera), radiance, exp2(-depth));
}
