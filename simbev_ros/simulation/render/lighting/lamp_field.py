"""Light of lamps on their surroundings, as maps around the ego seen from above.

Lit lamps of a world state enter, textures leave. Each texel holds the light that arrives there, and the height of the
lamps that it comes from, so that the cost per pixel does not grow with the number of lamps. There is one map for street
lamps, one for headlamps, and one for the colored glow of all other lamps. The latter two consist of a fine square
around the ego (left in the texture) and a coarse one (right).
"""

from collections.abc import Sequence

import moderngl
import numpy as np

from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.config.lights import MAX_COLORS
from simbev_ros.foundation.types import BoolArray, Float32Array, Float64Array, Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.lights import DEFAULT_FLUX_LM, LightSpec, street_lights
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.render.gl.programs import TEXTURE_UNITS, ProgramLibrary
from simbev_ros.simulation.render.lighting.lamp_shadows import DIRECTIONS, HALF_ANGLE_RAD, free_distances
from simbev_ros.simulation.render.lighting.lamps import VehicleLamps, lamp_kinds, signal_lamps, street_lamps
from simbev_ros.simulation.render.lighting.shop_fronts import find_shop_fronts

_SIZE_PX = 512
_HALF_M = 160.0
_FINE_HALF_M = 48.0
_STREET_REACH_M, _BEAM_REACH_M = 30.0, 120.0
_MAX_LAMPS = 1024  # more than any street has within range of the map
_LAMPS_PER_LINE = 128  # lamps per texture line; see shaders/shade_lamp.frag.glsl
_ATTRIBUTES = {"in_lamp": 3, "in_heading": 2, "in_extent": 4, "in_light": 4, "in_half_width": 1}
_ROW_FLOATS = sum(_ATTRIBUTES.values())
_BEAM_EXTENT_M = {1: (-0.5, 72.0, 1.5, 39.0), 2: (-0.5, _BEAM_REACH_M, 1.5, 65.0)}
"""Extent of a low and of a high beam: start, end, half width at the start and at the end."""

_SHOP_SIDE_M = 2.0
_BEACON_HZ = 2.0  # rotations of the beacon's light per second


class LampField:
    """Draws the light maps of each frame, and lists the lamps that are lit."""

    def __init__(
        self, context: moderngl.Context, library: ProgramLibrary, static: StaticScene, vehicles: VehicleLamps
    ) -> None:
        self._context = context
        self._vehicles = vehicles
        self._lights_m = np.array([light.position_m for light in static.street_lights], np.float64).reshape(-1, 3)
        self._strengths = np.ones(len(self._lights_m))
        self._fronts = find_shop_fronts(static.tiles)
        self._shop_light = np.zeros(3)
        self._lamps = context.buffer(reserve=_MAX_LAMPS * _ROW_FLOATS * 4)
        self._pools = {name: self._create_pool(library, name) for name in ("street", "beam", "glow")}
        self._fields = {
            name: self._create_field(f"{name}_field", squares)
            for name, squares in (("street", 1), ("beam", 2), ("glow", 2))
        }
        self._free = context.texture((DIRECTIONS, _MAX_LAMPS), 1, dtype="f4")
        self._free.use(TEXTURE_UNITS["beam_free"])
        lines = -(-max(len(self._lights_m), 1) // _LAMPS_PER_LINE)
        self._intensities = context.texture((_LAMPS_PER_LINE, lines), 1, dtype="f4")
        self._intensities.use(TEXTURE_UNITS["street_lamps"])

    def set_lights(self, lights: LightSpec) -> None:
        """Set the intensity of each street light when it is dark, and the light of shops."""
        table = street_lights(lights, self._lights_m)
        self._strengths = np.where(table["on"], table["intensity_lm"] / DEFAULT_FLUX_LM, 0.0)
        intensities = np.zeros((self._intensities.height, self._intensities.width), np.float32)
        intensities.flat[: len(table)] = self._strengths
        self._intensities.write(intensities.tobytes())
        buildings = lights.buildings
        colors = np.array([[color >> shift & 0xFF for shift in (16, 8, 0)] for color in buildings.colors[:MAX_COLORS]])
        share = 1.0 - (1.0 - buildings.share_lit) ** 4 if buildings.enabled else 0.0  # shaders/shade_wall.frag.glsl
        self._shop_light = share * lamp_kinds()["shop"]["glow"] * ((colors / 255.0) ** 2.2).mean(axis=0)

    def draw(self, world: WorldState, origin_m: Float64Array) -> Table:
        """Draw the maps of a world around (3,) ``origin_m``. Shaders read them only while lamps are lit.

        Returns:
            (N,) ``LAMP_DTYPE``: the lamps that are lit.
        """
        lamps = np.concatenate(
            [self._vehicles.lit_lamps(world.actors, origin_m), signal_lamps(world.signals, origin_m)]
        )
        beams = lamps[(lamps["beam"] > 0) & _near(lamps["at"], _BEAM_REACH_M)][:_MAX_LAMPS]
        if len(beams):
            free = free_distances(beams, world.actors, origin_m)
            self._free.write(free.tobytes(), (0, 0, DIRECTIONS, len(beams)))
        glow_lamps = lamps[(lamps["glow"] > 0.0) & _near(lamps["at"], 0.0)]
        glows = np.concatenate([self._shop_rows(origin_m), _glow_rows(glow_lamps, world.stamp_ns)])
        is_on = self._strengths > 0.0
        lights_m, strengths = self._lights_m[is_on] - origin_m, self._strengths[is_on]
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = (moderngl.ONE, moderngl.ONE)
        self._draw_lamps("street", _street_rows(lights_m, strengths), (_HALF_M,))
        self._draw_lamps("beam", _beam_rows(beams), (_FINE_HALF_M, _HALF_M))
        self._draw_lamps("glow", glows, (_FINE_HALF_M, _HALF_M))
        return np.concatenate([lamps, street_lamps(lights_m, strengths)])

    @staticmethod
    def texture_from_world() -> Float64Array:
        """(4, 4) texture coordinates in a coarse square, 0..1, from world points."""
        matrix = np.diag([0.5 / _HALF_M, 0.5 / _HALF_M, 0.0, 1.0])
        matrix[:2, 3] = 0.5
        return matrix

    def _create_pool(self, library: ProgramLibrary, name: str) -> moderngl.VertexArray:
        """Vertex array of the quads of one map's lamps."""
        program = library.load("lamp_pool.vert", f"{name}_pool.frag")
        if name == "beam":
            program["half_angle"] = HALF_ANGLE_RAD
        used = [attribute for attribute in _ATTRIBUTES if attribute in program]
        floats = " ".join(f"{n}f4" if name in used else f"{4 * n}x" for name, n in _ATTRIBUTES.items())
        return self._context.vertex_array(program, [(self._lamps, f"{floats}/i", *used)])

    def _create_field(self, name: str, squares: int) -> moderngl.Framebuffer:
        """A map of squares side by side, bound to the texture unit of its name."""
        texture = self._context.texture((_SIZE_PX * squares, _SIZE_PX), 4, dtype="f2")
        texture.repeat_x = texture.repeat_y = False
        texture.use(TEXTURE_UNITS[name])
        return self._context.framebuffer([texture])

    def _draw_lamps(self, name: str, rows: Float32Array, halves_m: Sequence[float]) -> None:
        """Sum up the light of (N, 14) lamps in the squares of a map."""
        field, pool = self._fields[name], self._pools[name]
        field.use()
        field.viewport = (0, 0, *field.size)
        field.clear()
        count = min(len(rows), _MAX_LAMPS)
        if count:
            self._lamps.write(rows[:count].astype(np.float32).tobytes())
        for square, half_m in enumerate(halves_m if count else ()):
            field.viewport = (square * _SIZE_PX, 0, _SIZE_PX, _SIZE_PX)
            pool.program["half_m"] = half_m
            pool.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=count)

    def _shop_rows(self, origin_m: Float64Array) -> Float32Array:
        """(N, 14) rows of shop fronts, which are lines of light."""
        kind = lamp_kinds()["shop"]
        position_m = self._fronts["at_m"] - origin_m + [0.0, 0.0, kind["up_m"]]
        fronts, position_m = self._fronts[near := _near(position_m, kind["reach_m"])], position_m[near]
        if not self._shop_light.any():
            fronts, position_m = fronts[:0], position_m[:0]
        rows = np.zeros((len(fronts), _ROW_FLOATS), np.float32)
        rows[:, :3], rows[:, 3:5] = position_m, fronts["facing"]
        side_m = fronts["half_m"] + _SHOP_SIDE_M
        rows[:, 5:9] = np.column_stack([np.zeros(len(rows)), np.full(len(rows), kind["reach_m"]), side_m, side_m])
        rows[:, 9:12], rows[:, 12], rows[:, 13] = self._shop_light, 1.0, fronts["half_m"]
        return rows


def _near(position_m: Float64Array, reach_m: float) -> BoolArray:
    """(N,) whether positions are on a map, or within ``reach_m`` of it."""
    return np.all(np.abs(position_m[:, :2]) < _HALF_M + reach_m, axis=1)


def _street_rows(lights_m: Float64Array, strengths: Float64Array) -> Float32Array:
    """(N, 14) rows of the lit street lamps within range of the map."""
    near = _near(lights_m, _STREET_REACH_M)
    rows = np.zeros((int(near.sum()), _ROW_FLOATS), np.float32)
    rows[:, :3], rows[:, 3], rows[:, 9] = lights_m[near], 1.0, strengths[near]
    rows[:, 5:9] = np.array([-1.0, 1.0, 1.0, 1.0]) * _STREET_REACH_M
    return rows


def _beam_rows(beams: Table) -> Float32Array:
    """(N, 14) rows of headlamps, with their upward slope and their row of free distances."""
    rows = np.zeros((len(beams), _ROW_FLOATS), np.float32)
    level = np.maximum(np.linalg.norm(beams["facing"][:, :2], axis=1), 1e-3)
    rows[:, :3], rows[:, 3:5] = beams["at"], beams["facing"][:, :2] / level[:, None]
    for beam, extent_m in _BEAM_EXTENT_M.items():
        rows[beams["beam"] == beam, 5:9] = extent_m
    rows[:, 9], rows[:, 10], rows[:, 11] = beams["beam"], beams["facing"][:, 2] / level, np.arange(len(beams))
    return rows


def _glow_rows(lamps: Table, stamp_ns: int) -> Float32Array:
    """(N, 14) rows of glowing lamps. Beacons shine all around and rotate; adjacent ones are half a turn apart."""
    rows = np.zeros((len(lamps), _ROW_FLOATS), np.float32)
    period_ns = round(NS_PER_S / _BEACON_HZ)
    beacons = lamps["forward"] == 0.0
    _, first, vehicle = np.unique(lamps["row"][beacons], return_index=True, return_inverse=True)
    phase = np.zeros(len(lamps))
    phase[beacons] = (np.arange(len(vehicle)) - first[vehicle]) % 2  # the beacons of a vehicle are consecutive
    turn = 2.0 * np.pi * ((stamp_ns % period_ns) / period_ns + 0.5 * phase)
    beacon = beacons[:, None]
    heading = np.where(beacon, np.stack([np.cos(turn), np.sin(turn)], axis=1), lamps["facing"][:, :2])
    reach_m = lamps["reach_m"][:, None]
    rows[:, :3], rows[:, 3:5] = lamps["at"], heading
    rows[:, 5:9] = np.where(beacon, [-0.4, 1.0, 1.0, 1.0], [-0.25, 1.0, 1.0, 1.0]) * reach_m
    rows[:, 9:12] = lamps["color"] * lamps["glow"][:, None]
    rows[:, 12] = np.where(lamps["forward"] > 0.0, lamps["forward"], 0.8)
    return rows
