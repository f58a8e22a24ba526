// Tunnels, from their map seen from above (render/lighting/tunnel_map.py); all of this costs nothing where there are none.
struct Tunnel {
    float inside;  // 1 inside a tunnel, 0 outside
    float depth;   // meters to the nearest portal
    float lamps;   // light of the lamps, as a share of that below one
};

#if TUNNELS
uniform sampler2D tunnel_map;  // height of the road, meters to the nearest portal, light of the lamps, coverage

const float TUNNEL_BELOW = 1.0;
const float TUNNEL_ABOVE = 5.3;
const float TUNNEL_BESIDE = 0.8;  // positions are moved this far along the normal, off walls and ceiling

Tunnel tunnel_at(vec3 position, vec3 normal) {
    vec3 here = position + TUNNEL_BESIDE * normal;
    vec4 found = texture(tunnel_map, here.xy * tunnel_place.w + tunnel_place.xy);
    float above = here.z + tunnel_place.z - found.x / max(found.w, 1e-3);
    bool inside = found.w > 0.5 && above > -TUNNEL_BELOW && above < TUNNEL_ABOVE;
    return Tunnel(inside ? 1.0 : 0.0, found.y / max(found.w, 1e-3), found.z);
}
#else
Tunnel tunnel_at(vec3 position, vec3 normal) { return Tunnel(0.0, 0.0, 0.0); }
#endif

const float SKY_REACH = 6.0;  // meters in which the light of the sky falls to 1 / e behind a portal

// Share of the sky's light that arrives.
float open_share(Tunnel tunnel) { return 1.0 - tunnel.inside * (1.0 - 0.7 * exp(-tunnel.depth / SKY_REACH)); }

// Share of rain water that vehicles carry in.
float wet_share(Tunnel tunnel) { return 1.0 - tunnel.inside * smoothstep(1.0, 14.0, tunnel.depth); }
