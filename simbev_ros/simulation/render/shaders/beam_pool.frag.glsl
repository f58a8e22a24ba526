#version 330
// Light of a headlamp: strength · (direction to the lamp), strength, strength · height of the beam's upper edge.
// A low beam's cutoff is horizontal on the left, 1 % below the axis, and rises by 15 degrees on the right (UN R112).
in vec2 v_offset;
flat in vec2 v_heading;
flat in vec4 v_light;  // 1 low or 2 high beam, tangent of its tilt, row of free_distance
flat in vec3 v_size;
uniform sampler2D beam_free;  // meters to the nearest actor; columns are directions from right to left
uniform float half_angle;
out vec4 field;

const float DIP = 0.01;
const float RISE = 0.268;       // tan 15 degrees
const float RISE_ENDS = 0.11;   // maximum offset to the right, as a share of the distance ahead
const float WIDEST = 0.5;       // radians to either side
const float HIGH_EDGE = 0.09;
const float HIGHEST = 3.0;      // maximum height of a high beam's edge above the lamp, meters

float unhindered(float angle, float distance) {
    int last = textureSize(beam_free, 0).x - 1;
    float place = (angle / half_angle * 0.5 + 0.5) * float(last + 1) - 0.5;
    int column = clamp(int(floor(place)), 0, last), row = int(v_light.z + 0.5);
    vec2 free = vec2(texelFetch(beam_free, ivec2(column, row), 0).x, texelFetch(beam_free, ivec2(min(column + 1, last), row), 0).x);
    vec2 open = clamp((free - distance) * 3.0 + 1.0, 0.0, 1.0);
    return mix(open.x, open.y, fract(place));
}

void main() {
    float ahead = max(v_offset.x, 0.05), right = -v_offset.y;
    float distance = length(v_offset), angle = atan(v_offset.y, ahead);
    bool high = v_light.x > 1.5;
    // To the right a low beam reaches farther, because its cutoff rises there.
    float reach = high ? v_size.z : v_size.z * mix(0.66, 1.0, smoothstep(-0.04, 0.06, right / ahead));
    float fading = clamp(1.0 - distance * distance / (reach * reach), 0.0, 1.0);
    float wide = max(1.0 - angle * angle / (WIDEST * WIDEST), 0.0), narrow = exp2(-(high ? 50.0 : 30.0) * angle * angle);
    float shape = 0.75 * wide * wide + (high ? 2.4 : 1.5) * narrow * distance / (distance + 6.0);
    float strength = shape * fading * fading * smoothstep(0.0, 3.0, v_offset.x) / (1.0 + (high ? 0.002 : 0.005) * distance * distance);
    strength *= unhindered(angle, distance);

    float kink = RISE * clamp(right, 0.0, RISE_ENDS * ahead);
    float edge = high ? min(HIGH_EDGE * ahead, HIGHEST) : kink - DIP * ahead;
    float height = v_size.x + v_light.y * ahead + edge;
    vec2 direction = -normalize(v_heading * v_offset.x + vec2(-v_heading.y, v_heading.x) * v_offset.y + 1e-4);
    field = strength * vec4(direction, 1.0, height);
}
