// Light on a surface: sun or moon with shadow, sky and ground, reflections, lamps, fog; then the camera's response.
#include "film"
#include "pixel"
#include "sky"
#include "lamps"
#include "log_depth"
#include "tunnel"
#include "sunlit"
uniform sampler2D visibility;

out vec4 shaded;  // sRGB, luma

float lamps_lit() { return LAMPS_LIT; }  // a constant, so that lamps cost nothing by day

const vec3 LUMA = vec3(0.299, 0.587, 0.114);

struct Surface {
    vec3 albedo;
    vec3 normal;
    float roughness;
    float metallic;
    float specular;      // reflectance at normal incidence
    vec3 emission;       // image brightness: 1 is white, independent of the exposure
    float translucency;  // share of transmitted light, for leaves
};

Surface surface_of(Pixel p) {
    vec4 material = materials[p.material];
    return Surface(p.albedo, p.normal, material.x, material.y, material.z, vec3(0.0), 0.0);
}

vec3 sun_highlight(Surface s, vec3 to_camera, float facing) {
    vec3 halfway = normalize(to_camera + key_direction.xyz);
    float alpha = max(s.roughness * s.roughness, 0.003);
    float along = max(dot(s.normal, halfway), 0.0);
    float spread = along * along * (alpha * alpha - 1.0) + 1.0;
    float distribution = alpha * alpha / (spread * spread);
    float masking = 0.25 / mix(max(dot(to_camera, halfway), 0.1), 1.0, alpha);
    return vec3(min(distribution * masking * facing, 60.0));
}

// Linear radiance of a surface. ambient_share: share of sky and ground not blocked nearby; sun: share of the key light.
vec3 lit(Pixel p, Surface s, float ambient_share, float sun) {
    float facing = dot(s.normal, key_direction.xyz);
    float through = s.translucency * max(-facing, 0.0);
    vec3 ambient = mix(ground_ambient.rgb, sky_ambient.rgb, 0.5 + 0.5 * s.normal.z) * ambient_share;
    float open = 1.0;
    vec3 enclosed = vec3(0.0);
#if TUNNELS
    Tunnel tunnel = tunnel_at(p.position, s.normal);
    open = open_share(tunnel);
    enclosed = tunnel_light.rgb * (tunnel.inside * (0.45 + 0.55 * tunnel.lamps) * ambient_share);
    ambient = ambient * open + enclosed * (0.72 + 0.28 * s.normal.z);
    enclosed *= 0.35;  // of what surfaces mirror: walls and ceiling
#endif
    vec3 lamps = vec3(0.0);
    if (lamps_lit() > 0.0) lamps = lamp_light(p.position, s.normal);
    vec3 diffuse = s.albedo * (1.0 - s.metallic) * (key_light.rgb * sun * (max(facing, 0.0) + through) + ambient + lamps);

    vec3 base = mix(vec3(s.specular), s.albedo, s.metallic);
    float grazing = 1.0 - max(dot(s.normal, p.to_camera), 0.0);
    float grazing2 = grazing * grazing;
    vec3 fresnel = base + (max(vec3(1.0 - s.roughness), base) - base) * grazing2 * grazing2 * grazing;
    vec3 mirrored = surroundings(reflect(-p.to_camera, s.normal), s.roughness) * (ambient_share * open) + enclosed + lamps * 0.3;
    vec3 specular = fresnel * (mirrored * (1.0 - 0.7 * s.roughness) + key_light.rgb * sun * sun_highlight(s, p.to_camera, max(facing, 0.0)));
    return diffuse + specular + s.emission / exposure();
}

vec4 developed(vec3 radiance) {
    vec3 color = film(radiance * (exposure() * viewport.w));
    return vec4(color, dot(color, LUMA));
}

float log2_at(ivec2 pixel) { return log2(texelFetch(g_depth, pixel, 0).x); }

// Openness and share of the key light, from the surrounding texels that lie on about the same surface.
vec2 visibility_at(float depth) {
#if VISIBILITY_STEP == SHADING_STEP
    return texelFetch(visibility, ivec2(gl_FragCoord.xy), 0).xy;
#else
    ivec2 pixel = shaded_pixel(), cell = pixel / VISIBILITY_STEP, last = textureSize(visibility, 0) - 1;
    vec2 between = vec2(pixel - cell * VISIBILITY_STEP) / float(VISIBILITY_STEP);
    float here = log2(depth);
#ifdef COMPUTED
    ivec2 first = pixel - (ivec2(gl_FragCoord.xy) & 1) * SHADING_STEP, next = min(first + SHADING_STEP, ivec2(viewport.xy) - 1);
    vec2 slope = vec2(log2_at(ivec2(next.x, pixel.y)) - log2_at(ivec2(first.x, pixel.y)), log2_at(ivec2(pixel.x, next.y)) - log2_at(ivec2(pixel.x, first.y)));
#else
    vec2 slope = vec2(dFdx(here), dFdy(here));
#endif
    slope *= float(VISIBILITY_STEP / SHADING_STEP);
    vec2 total = vec2(0.0);
    float weights = 0.0;
    for (int tap = 0; tap < 4; ++tap) {
        vec2 corner = vec2(tap & 1, tap >> 1);
        vec4 found = texelFetch(visibility, min(cell + ivec2(corner), last), 0);
        vec2 share = mix(1.0 - between, between, corner) + 0.01;
        float weight = share.x * share.y * same_surface(log2_depth(found.zw) - here, slope, corner - between);
        total += weight * found.xy;
        weights += weight;
    }
    return total / weights;
#endif
}

void shade(Pixel p, Surface s) {
    vec2 visible = visibility_at(p.depth);
    if (SUN_PER_PIXEL) visible.y = sunlit(p.position, p.normal, vec2(0.0));
    vec3 radiance = lit(p, s, visible.x, visible.y);
    shaded = developed(through_air(radiance, p.to_camera, p.position));
}
