#version 330
// A lamp's reflection on a wet, rough, horizontal surface (Beckmann distribution, Schlick's approximation of Fresnel's law).
#include "enums"
#include "pixel"
#include "light"
#include "noise"
in vec3 v_across;
flat in vec3 v_lamp;
flat in vec3 v_light;  // color · candela
flat in vec4 v_facing;
out vec4 added;

const float ROUGHNESS2 = 0.011;
const float RADIANCE_PER_CANDELA = 0.009;  // per m², in the unit of sky.yaml
const vec3 LUMA = vec3(0.299, 0.587, 0.114);

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    uvec2 surface = texelFetch(g_surface, texel, 0).xy;
    vec3 ray = mat3(world_from_optical) * optical_ray(vec2(texel));
    vec3 position = world_from_optical[3].xyz + ray * min(texelFetch(g_depth, texel, 0).x, 1e4);
    vec3 normal = unpack_normal(surface.y), view = -normalize(ray);
    uint material = surface.x >> 24u;
    bool smooth_ground = material <= MATERIAL_CONCRETE && material != MATERIAL_PLAIN;
    vec3 to_lamp = v_lamp - position;
    float distance2 = max(dot(to_lamp, to_lamp), 0.5);
    to_lamp *= inversesqrt(distance2);
    vec3 halfway = normalize(view + to_lamp);
    float cosine = max(dot(normal, halfway), 0.05), cosine2 = cosine * cosine;
    float distribution = exp2(1.4427 * (1.0 - 1.0 / cosine2) / ROUGHNESS2) / (3.1416 * ROUGHNESS2 * cosine2 * cosine2);
    float grazing = 1.0 - max(dot(view, halfway), 0.0), grazing2 = grazing * grazing;
    float mirrored = (0.02 + 0.98 * grazing2 * grazing2 * grazing) * distribution / (4.0 * max(dot(normal, view), 0.06));
    float ahead = max(-dot(v_facing.xyz, to_lamp), 0.0);
    float sent = mix(1.0, ahead, v_facing.w) / distance2;
    // It fades toward the borders of the streak, and coarse grains break it up.
    float across = v_across.x / v_across.z, window = (1.0 - across * across) * min((1.0 - v_across.y) * 4.0, 1.0);
    float size = length(ray) * 4.0 / intrinsics.x * length(position - world_from_optical[3].xyz);
    float grain = 0.45 + 1.1 * noise_at((position + noise_origin.xyz).xy / 1.6, size / 1.6).g;
    bool level = smooth_ground && normal.z > 0.95 && dot(normal, to_lamp) > 0.0;
    vec3 x = level ? v_light * sent * mirrored * max(window, 0.0) * grain * RADIANCE_PER_CANDELA * exposure() * viewport.w : vec3(0.0);
    vec3 color = 1.0 - exp2(-pow(x, vec3(0.7)));
    added = vec4(color, dot(color, LUMA));
}
