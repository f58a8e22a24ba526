#version 330
// Colored light near a lamp or a line of lamps: color, luma · height of the lamp.
in vec2 v_offset;
flat in vec2 v_heading;
flat in vec4 v_light;  // color; 0 shines all around, 1 only ahead
flat in vec3 v_size;
out vec4 field;

const float NEAR = 1.3;   // meters within which it hardly fades
const float GAP = 2.0;    // a lamp does not light the body that it is mounted in
const vec3 LUMA = vec3(0.299, 0.587, 0.114);

void main() {
    vec2 offset = vec2(v_offset.x, max(abs(v_offset.y) - v_size.y, 0.0));
    float distance2 = dot(offset, offset);
    float fading = clamp(1.0 - distance2 / (v_size.z * v_size.z), 0.0, 1.0);
    float ahead = (offset.x + 0.1) * inversesqrt(distance2 + 0.05);
    float lobe = mix(1.0, max(ahead, 0.0) * smoothstep(0.0, v_size.y > 0.0 ? 0.3 : GAP, offset.x), v_light.w);
    // A strong or high lamp has a longer range and fades later.
    float near = NEAR + 0.1 * v_size.z;
    vec3 light = v_light.rgb * lobe * fading * fading / (1.0 + distance2 / (near * near));
    field = vec4(light, dot(light, LUMA) * v_size.x);
}
