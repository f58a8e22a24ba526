"""Map of the tunnels around the ego, seen from above, and the adaptation of cameras to the light in them.

Shaders look up whether a point lies in a tunnel, how far away the nearest portal is, and how much light of the lamps
arrives. The map is drawn again only when the ego leaves a coarse grid cell, and is kept for each agent.
"""

from typing import NamedTuple

import moderngl
import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.simulation.render.gl.programs import TEXTURE_UNITS, ProgramLibrary
from simbev_ros.simulation.render.lighting.light import SkyLight
from simbev_ros.simulation.render.lighting.recent_maps import RecentMaps

_HALF_M = 320.0
_SIZE_PX = 1024
_STEP_M = 64.0  # grid spacing of the map's center, which follows the ego in such steps
_BESIDE_M = 0.4  # pieces are widened by this, so that they reach below the walls
_LAMP_REACH_M = 8.0
_LAMPS = 0.2 * np.array([1.0, 0.92, 0.80])
"""Irradiance / pi below a lamp."""
_ADAPTED = 0.95
"""Brightness of white paper below a lamp in the image of an adapted camera."""
_ADAPTED_AT_M = 30.0


class TunnelAdaptation(NamedTuple):
    """How far cameras have adapted to a tunnel.

    Attributes:
        depth_m: Distance from the ego to the nearest portal; 0 outside of tunnels.
        inside: 0 outside of tunnels, 1 deep inside.
        factor: Factor of the automatic exposure.
    """

    depth_m: float
    inside: float
    factor: float


class TunnelMap:
    """Draws the map of tunnels; without tunnels it is empty and costs nothing."""

    def __init__(self, context: moderngl.Context, library: ProgramLibrary, tunnels: Tunnels) -> None:
        self._context, self._tunnels = context, tunnels
        self._maps: RecentMaps[tuple[float, ...], moderngl.Framebuffer] = RecentMaps(self._create_map)
        if not tunnels:
            return
        self._base_m = np.round(tunnels.corners_m.reshape(-1, 3).mean(axis=0))
        tubes = library.load("tunnel_tube.vert", "tunnel_tube.frag")
        pools = library.load("tunnel_pool.vert", "tunnel_pool.frag")
        rows = _tube_rows(tunnels, self._base_m)
        self._tubes = context.vertex_array(tubes, [(context.buffer(rows.tobytes()), "3f4 f4", "in_place", "in_depth")])
        lamps = (tunnels.lamps_m - self._base_m).astype(np.float32)
        self._lamp_count = len(lamps)
        self._pools = context.vertex_array(pools, [(context.buffer(lamps.tobytes() or bytes(12)), "3f4/i", "in_lamp")])
        tubes["half_m"] = pools["half_m"] = _HALF_M
        pools["reach"] = _LAMP_REACH_M

    def set_agents(self, count: int) -> None:
        """Keep the maps around this number of agents; until this is called, around one."""
        self._maps.max_count = count

    def adaptation(self, ego_m: Float64Array, sky: SkyLight) -> TunnelAdaptation:
        """The adaptation of the cameras of an ego at (3,) ``ego_m``, map frame."""
        depth_m = float(self._tunnels.depths_m(ego_m[None])[0]) if self._tunnels else 0.0
        inside = min(depth_m / _ADAPTED_AT_M, 1.0)
        full = _ADAPTED / (float(_LAMPS.max()) * sky.exposure)
        return TunnelAdaptation(depth_m, inside, full**inside)

    def draw(self, origin_m: Float64Array, adaptation: TunnelAdaptation) -> Float64Array:
        """Select the map around (3,) ``origin_m`` for shaders, and draw it unless it is there already.

        Returns:
            (2, 4) the last vectors of the uniform block ``Light`` (shaders/include/light.glsl).
        """
        if not self._tunnels:
            return np.zeros((2, 4))
        center_m = np.round(origin_m / _STEP_M) * _STEP_M
        framebuffer, drawn = self._maps.find(tuple(center_m))
        if drawn != tuple(center_m):
            self._draw_around(center_m, framebuffer)
        texture = framebuffer.color_attachments[0]
        assert isinstance(texture, moderngl.Texture)
        texture.use(TEXTURE_UNITS["tunnel_map"])
        offset_m = origin_m - center_m
        place = [*(0.5 + offset_m[:2] * (0.5 / _HALF_M)), offset_m[2], 0.5 / _HALF_M]
        return np.array([place, [*_LAMPS, min(adaptation.depth_m, 1e3)]])

    def _create_map(self) -> moderngl.Framebuffer:
        texture = self._context.texture((_SIZE_PX, _SIZE_PX), 4, dtype="f2")
        texture.repeat_x = texture.repeat_y = False
        return self._context.framebuffer([texture])

    def _draw_around(self, center_m: Float64Array, framebuffer: moderngl.Framebuffer) -> None:
        framebuffer.use()
        framebuffer.clear()
        self._context.enable_only(moderngl.NOTHING)
        for part in (self._tubes, self._pools):
            part.program["center"] = tuple(center_m - self._base_m)
        self._tubes.render(moderngl.TRIANGLES)
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = (moderngl.ONE, moderngl.ONE)
        if self._lamp_count:
            self._pools.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=self._lamp_count)
        self._context.enable_only(moderngl.NOTHING)


def _tube_rows(tunnels: Tunnels, base_m: Float64Array) -> Float64Array:
    """(6 Q, 4) float32 corners of two triangles for each piece, and their distances to the nearest portal."""
    corners_m = tunnels.corners_m.copy()
    across_m = corners_m[:, [3, 2]] - corners_m[:, [0, 1]]
    across_m[..., 2] = 0.0
    length_m = np.maximum(np.linalg.norm(across_m, axis=2, keepdims=True), 1e-3)
    corners_m[:, [3, 2]] += across_m / length_m * _BESIDE_M
    corners_m[:, [0, 1]] -= across_m / length_m * _BESIDE_M
    points_m = corners_m[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    depth_m = np.minimum(tunnels.portal_distances_m(points_m), 1e3)
    return np.column_stack([points_m - base_m, depth_m]).astype(np.float32)
