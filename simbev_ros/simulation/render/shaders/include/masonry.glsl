// Walls of bricks with their mortar.
#include "noise"

const vec2 BRICK_SIZE = vec2(0.25, 0.085);
const vec3 MORTAR = vec3(0.34, 0.32, 0.29);
const vec3 GRAY = vec3(0.299, 0.587, 0.114);

// weather: 0..1 noise.
vec3 brickwork(vec3 wall, vec2 uv, float weather, float size) {
    vec2 course = uv / BRICK_SIZE;
    course.x += 0.5 * mod(floor(course.y), 2.0);
    vec4 brick = randoms(floor(course) + 8192.0);
    float burnt = brick.y > 0.93 ? 0.45 : 0.0;
    float apart = seen_apart(BRICK_SIZE.y, size);
    vec3 tone = 1.0 + ((brick.x - 0.5) * 0.42 - burnt + 0.03) * apart + vec3(0.10, 0.0, -0.08) * (brick.z - 0.5) * apart;
    vec3 clay = mix(wall, vec3(dot(wall, GRAY)), 0.25) * 0.85 * tone;
    return mix(clay, MORTAR * (0.75 + 0.5 * weather), 0.8 * joint_cover(course * BRICK_SIZE, BRICK_SIZE, 0.011, size));
}
