#version 330
// Semantic tag and actor id of the nearest surface.
uniform usampler2D g_surface;
uniform usampler2D rigid_actors;

layout(location = 0) out uint semantic;
layout(location = 1) out uint instance;

void main() {
    uint bits = texelFetch(g_surface, ivec2(gl_FragCoord.xy), 0).x;
    uint row = bits & 0xFFFFu;
    semantic = (bits >> 16u) & 0xFFu;
    instance = texelFetch(rigid_actors, ivec2(row & 127u, row >> 7u), 0).x;
}
