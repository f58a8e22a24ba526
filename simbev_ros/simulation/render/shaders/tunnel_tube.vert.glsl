#version 330
// Pieces of tunnels on a map seen from above.
uniform float half_m;
uniform vec3 center;  // of the map, relative to the origin of the tunnels
in vec3 in_place;     // on the road, relative to the origin of the tunnels
in float in_depth;
out vec2 v_tube;      // height of the road above the center, meters to the nearest portal

void main() {
    v_tube = vec2(in_place.z - center.z, in_depth);
    gl_Position = vec4((in_place.xy - center.xy) / half_m, 0.0, 1.0);
}
