#version 330
// Share of the sky that an actor blocks from the ground, and that share times the ground's height.
in vec2 v_offset;
flat in vec3 v_actor;
out vec2 contact;

void main() {
    vec2 soft = min(v_actor.xy, vec2(0.45));
    vec2 outside = max(abs(v_offset) - v_actor.xy + soft, 0.0) / (soft + 0.4);
    float hidden = 0.8 * (1.0 - smoothstep(0.0, 1.0, length(outside)));
    contact = hidden * vec2(1.0, v_actor.z);
}
