"""Spray that vehicles throw up from wet roads, as soft puffs behind their wheels; only color images show it.

A puff drifts after its vehicle, rises, grows and fades. It follows from the vehicle's pose and the time alone: all
cameras of a frame see the same spray.
"""

import moderngl
import numpy as np

from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import AnyArray, Float64Array, Table
from simbev_ros.foundation.units import NS_PER_S, S_PER_NS
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.simulation.render.gl.programs import ProgramLibrary

PUFF_DTYPE = np.dtype([("at", "<f4", 3), ("radius_m", "<f4"), ("opacity", "<f4"), ("seed", "<f4")])
LIFE_NS = 3 * NS_PER_S // 4
_VEHICLES = (Tag.CAR, Tag.TRUCK, Tag.BUS, Tag.MOTORCYCLE)
_PUFFS = 14  # of each wheel track
_SPEED_MPS = (5.0, 24.0)  # without spray, with most
_OPACITY, _REACH_M, _MAX_VEHICLES = 0.30, 90.0, 40
_WHEEL_SHARE = np.array([-0.32, 0.38])  # position of the rear wheels, along the length and across the width
_DRAGGED = 0.45  # share of the vehicle's path along which the air behind it drags a puff
_START_M, _SPREAD_MPS, _RISE_MPS = 0.22, 1.5, 1.0


class Spray:
    """Draws the spray of a frame over the shaded image of each camera; nothing is compiled on dry roads."""

    def __init__(self, context: moderngl.Context, library: ProgramLibrary) -> None:
        self._context, self._library = context, library
        self._puffs = context.buffer(reserve=_MAX_VEHICLES * 2 * _PUFFS * PUFF_DTYPE.itemsize)
        self._arrays: dict[bool, moderngl.VertexArray] = {}
        self._count = 0

    def set_world(self, world: WorldState, origin_m: Float64Array) -> None:
        """Set the puffs of a world around (3,) ``origin_m``."""
        puffs = spray_puffs(world, origin_m)
        self._count = len(puffs)
        self._puffs.write(puffs.tobytes())

    def draw(self, lamps_lit: bool) -> None:
        """Draw into the current framebuffer, the shaded image; the G-buffer must be bound."""
        if not self._count:
            return
        if lamps_lit not in self._arrays:
            program = self._library.load("spray.vert", "spray.frag", LIT=int(lamps_lit))
            layout = (self._puffs, "3f4 1f4 1f4 1f4/i", "in_at", "in_radius", "in_opacity", "in_seed")
            self._arrays[lamps_lit] = self._context.vertex_array(program, [layout])
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = (moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA, moderngl.ZERO, moderngl.ONE)  # type: ignore[assignment]
        self._arrays[lamps_lit].render(moderngl.TRIANGLE_STRIP, vertices=4, instances=self._count)
        self._context.enable_only(moderngl.NOTHING)


def spray_puffs(world: WorldState, origin_m: Float64Array) -> Table:
    """(N,) puffs in the world around (3,) ``origin_m``, farthest vehicle first; opacity and seed are 0 to 1."""
    wet = world.weather.wetness / 100.0
    actors = world.actors[np.isin(world.actors["tag"], _VEHICLES)]
    speed_mps = np.hypot(actors["vx"], actors["vy"]).astype(np.float64)
    range_m = np.hypot(actors["x"] - origin_m[0], actors["y"] - origin_m[1])
    moving = np.flatnonzero((speed_mps > _SPEED_MPS[0]) & (range_m < _REACH_M)) if wet > 0.0 else np.zeros(0, int)
    order = moving[np.argsort(range_m[moving], kind="stable")][:_MAX_VEHICLES][::-1]
    actors, speed_mps = actors[order], speed_mps[order, None, None]
    poses = map_from_actors(actors)[:, None, None]
    side, number = np.array([1, -1])[:, None], np.arange(_PUFFS)
    phase = _random(actors["id"][:, None, None], side, 0) + number / _PUFFS
    turns = world.stamp_ns / LIFE_NS + phase
    age = turns % 1.0
    key = actors["id"][:, None, None], side * (number + 1), np.floor(turns).astype(np.int64)
    age_s = age * LIFE_NS * S_PER_NS
    size = np.clip(actors["height"] / 1.5, 0.7, 2.2)[:, None, None]
    along_m = actors["length"][:, None, None] * _WHEEL_SHARE[0] - speed_mps * age_s * (1.0 - _DRAGGED)
    across_m = (
        side * actors["width"][:, None, None] * _WHEEL_SHARE[1] + (_random(*key) - 0.5) * (0.2 + 1.2 * age_s) * size
    )
    across_m = across_m - along_m * actors["wz"][:, None, None] * age_s * (1.0 - _DRAGGED) / 2.0  # along the path's arc
    up_m = _START_M + _RISE_MPS * age_s * size * (0.5 + _random(*key[::-1]))
    offset_m = np.stack(np.broadcast_arrays(along_m, across_m, up_m), axis=-1)
    puffs = np.zeros(offset_m.shape[:-1], PUFF_DTYPE)
    puffs["at"] = (poses[..., :3, :3] @ offset_m[..., None])[..., 0] + poses[..., :3, 3] - origin_m
    puffs["radius_m"] = (_START_M + _SPREAD_MPS * age_s) * size
    amount = np.clip((speed_mps - _SPEED_MPS[0]) / (_SPEED_MPS[1] - _SPEED_MPS[0]), 0.0, 1.0) ** 0.8
    puffs["opacity"] = _OPACITY * wet * amount * np.minimum(age * 8.0, 1.0) * (1.0 - age)
    puffs["seed"] = _random(key[0], key[2], key[1])
    return puffs.reshape(-1)


def _random(a: AnyArray, b: AnyArray, c: AnyArray | int) -> Float64Array:
    """Random numbers 0..1 for integers that broadcast."""
    return np.asarray(np.sin(a * 12.9898 + b * 78.233 + c * 37.719) * 43758.5453 % 1.0)
