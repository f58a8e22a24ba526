// The surface visible at this pixel, read from the G-buffer.
#include "pack"
#include "view"
uniform usampler2D g_surface;
uniform sampler2D g_depth;
uniform sampler2D g_color;

layout(std140) uniform Materials { vec4 materials[64]; };  // roughness, metallic, specular

struct Pixel {
    vec3 position;  // world
    vec3 normal;
    vec3 to_camera;
    vec2 uv;
    vec3 albedo;    // linear
    uint material;
    uint row;       // row in the table of rigid parts
    float depth;
    float size;     // size of the pixel on the surface, meters
};

vec3 linear_color(vec3 srgb) { return srgb * (srgb * (srgb * 0.305306 + 0.682171) + 0.012523); }

// The pixel that a surface shader represents: the first of SHADING_STEP x SHADING_STEP.
ivec2 shaded_pixel() { return ivec2(gl_FragCoord.xy) * SHADING_STEP; }

Pixel this_pixel() {
    ivec2 texel = shaded_pixel();
    uvec4 surface = texelFetch(g_surface, texel, 0);
    vec3 ray = mat3(world_from_optical) * optical_ray(vec2(texel));
    Pixel p;
    p.depth = texelFetch(g_depth, texel, 0).x;
    p.position = world_from_optical[3].xyz + ray * p.depth;
    p.to_camera = -normalize(ray);
    p.normal = unpack_normal(surface.y);
    p.uv = uintBitsToFloat(surface.zw);
    p.albedo = linear_color(texelFetch(g_color, texel, 0).rgb);
    p.material = surface.x >> 24u;
    p.row = surface.x & 0xFFFFu;
    p.size = float(SHADING_STEP) * p.depth / intrinsics.x * inversesqrt(max(dot(p.normal, p.to_camera), 0.06));
    return p;
}
