#version 330
// The square or strip of ground that a lamp reaches, on a map from above.
uniform float half_m;
in vec3 in_lamp;
in vec2 in_heading;
in float in_kind;  // 0 street lamp, 1 low beam, 2 high beam
in float in_strength;

out vec2 v_ground;
flat out vec3 v_lamp;
flat out vec3 v_heading;  // and kind
flat out float v_strength;

const float STREET_REACH = 30.0;
const vec3 HEAD_REACH = vec3(-1.0, 42.0, 14.0);  // from, to, half width

void main() {
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    vec2 along = in_heading, across = vec2(-in_heading.y, in_heading.x);
    float forward = mix(HEAD_REACH.x, HEAD_REACH.y * in_kind, corner.x * 0.5 + 0.5);
    vec2 head = along * forward + across * corner.y * HEAD_REACH.z;
    v_ground = in_lamp.xy + (in_kind == 0.0 ? corner * STREET_REACH : head);
    v_lamp = in_lamp;
    v_heading = vec3(in_heading, in_kind);
    v_strength = in_strength;
    gl_Position = vec4(v_ground / half_m, 0.0, 1.0);
}
