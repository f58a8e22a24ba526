"""Echoes along the beams of a lidar: through panes and leaves, in mirrors, and at edges that cut a beam.

Each beam first meets the surfaces that its ray hits. Clear glass and the gaps of leaves let a share pass, to what lies
behind them and back the same way. Panes and water mirror a share by Fresnel's law (Schlick's approximation); what it
meets then comes back the same way, so it seems to lie behind the mirror. Where neighboring rays of a channel end at
different ranges, an edge lies somewhere between them, and cuts those beams that are wide enough to reach it: they have
an echo of each side.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from simbev_ros.assets.materials import Material, load_materials
from simbev_ros.foundation.types import (
    BoolArray,
    Float32Array,
    Float64Array,
    Int64Array,
    Table,
    UInt8Array,
    UInt32Array,
)
from simbev_ros.simulation.raycast.scene import Hits
from simbev_ros.simulation.sensors.lidar_echo import surface_strength
from simbev_ros.simulation.sensors.lidar_texture import texture_factor
from simbev_ros.simulation.sensors.lidar_window import Windows

_MAX_PANES = 3
_CLEARANCE_M = 0.01  # from a surface to the start of what passes or is mirrored
_LEAF_DEPTH_M = 0.3  # mean depth at which leaves behind the surface of a crown send light back
_MIN_SHARE = 0.01
_MIN_COS = 1e-3
_MIN_JUMP_M = 0.3
_MEAN_COLOR = 0xBABABA  # half as much light as white


@dataclass(frozen=True, slots=True)
class Echoes:
    """M echoes of beams, in no order.

    Attributes:
        ray: (M,) the beams.
        range_m: (M,) distances that the light travels one way.
        strength: (M,) strengths relative to white paper at the same range, as in ``lidar_echo``.
    """

    ray: Int64Array
    range_m: Float32Array
    strength: Float32Array

    def of(self, rows: Int64Array | BoolArray) -> "Echoes":
        """Some of the echoes, by index or mask."""
        rows = np.flatnonzero(rows) if rows.dtype == np.bool_ else rows
        return Echoes(self.ray.take(rows), self.range_m.take(rows), self.strength.take(rows))

    @classmethod
    def joined(cls, parts: list["Echoes"]) -> "Echoes":
        """The echoes of all parts."""
        columns = ([getattr(part, name) for part in parts] for name in ("ray", "range_m", "strength"))
        return cls(*map(np.concatenate, columns))


@dataclass(frozen=True, slots=True)
class Beams:
    """(N,) beams and what they meet first.

    Attributes:
        origins_m: (N, 3) or (1, 3) origins, map frame.
        directions: (N, 3) unit vectors, map axes.
        lag_s: (N,) time before the tick; None: all at the tick.
        hits: (N,) first hits.
        uniform: (N, 2) uniform random numbers.
    """

    origins_m: Float64Array
    directions: Float32Array
    lag_s: Float64Array | None
    hits: Hits
    uniform: Float32Array


Cast = Callable[[Float64Array, Float32Array, Float64Array | None], Hits]


def surface_echoes(
    beams: Beams, windows: Windows, cast: Cast, actors: Table, wetness: float, stretch: float, strongest: bool
) -> tuple[Echoes, Echoes]:
    """Echoes of the surfaces that beams meet first, and of what they meet through and in these.

    Args:
        beams: The beams.
        windows: Those that first meet windows.
        cast: Function that casts rays.
        actors: The actors that rays hit, for their colors.
        wetness: 0 dry to 1 wet.
        stretch: Angle of the beam divided by half the length of a pulse, 1/m. The echo of a surface that the beam hits
            at a slant is as long as the spot is deep, and its peak lower.
        strongest: Whether to leave out what would be weaker than the surface in front of it, were it white and matte.
    """
    table = load_materials()
    returns = np.flatnonzero(np.isfinite(beams.hits.range_m))
    # Most beams return, so the others take part at first, with a range of 0: this copies less than leaving them out.
    hits = replace(beams.hits, range_m=np.where(np.isfinite(beams.hits.range_m), beams.hits.range_m, np.float32(0.0)))
    ray = np.arange(len(hits.range_m))
    share, before_m = np.ones(len(ray), np.float32), np.zeros(len(ray), np.float32)
    origins_m, directions, found = beams.origins_m, beams.directions, []
    for number in range(_MAX_PANES):
        material = hits.material
        strength = surface_strength(material, hits.cos_angle, _colors(hits, actors), wetness)
        depth_m = np.zeros(len(ray), np.float32)
        slant2 = 1.0 / np.square(np.maximum(hits.cos_angle, _MIN_COS)) - 1.0
        strength *= share / np.sqrt(1.0 + np.square(np.float32(stretch) * (before_m + hits.range_m)) * slant2)
        along_m = directions * hits.range_m[:, None]
        strength *= texture_factor(hits, along_m + origins_m.astype(np.float32))
        if number == 0:
            rooms = _look_into(windows, hits, strength, depth_m)
        leaves = np.flatnonzero(material == Material.FOLIAGE)
        gap, depth_m[leaves] = _in_crowns(beams.uniform[ray[leaves]])
        strength[leaves] *= 1.0 - gap
        found.append(Echoes(ray, before_m + hits.range_m + depth_m, strength))
        if number == _MAX_PANES - 1:
            break
        beyond = np.flatnonzero(_ways_on().take(material))
        passing = table.lidar_transmission.take(material[beyond])
        mirrored = _mirrored(material[beyond], hits.cos_angle[beyond])
        passing[np.searchsorted(beyond, leaves)] = gap
        share, ahead = share[beyond], directions[beyond]
        ways = [(np.square((1.0 - mirrored) * passing) * share, ahead)]
        if number == 0:
            reflected = ahead + 2.0 * hits.cos_angle[beyond, None] * hits.normal[beyond]
            ways.append((np.square(mirrored) * share, reflected))
        weakest = np.maximum(strength[beyond], _MIN_SHARE) if strongest else _MIN_SHARE
        further = [(np.flatnonzero(rest > weakest), rest, toward) for rest, toward in ways]
        row = beyond[np.concatenate([rows for rows, _, _ in further])]
        if not len(row):
            break
        share = np.concatenate([rest[rows] for rows, rest, _ in further])
        directions = np.concatenate([toward[rows] for rows, _, toward in further]).astype(np.float32)
        starts_m = origins_m if len(origins_m) == 1 else origins_m[row]
        origins_m = starts_m + along_m[row] + _CLEARANCE_M * directions
        ray, before_m = ray[row], before_m[row] + hits.range_m[row]
        hits = cast(origins_m, directions, None if beams.lag_s is None else beams.lag_s[ray])
        there = np.flatnonzero(np.isfinite(hits.range_m))
        hits, ray, share, before_m = hits.of(there), ray[there], share[there], before_m[there] + _CLEARANCE_M
        origins_m, directions = origins_m[there], directions[there]
    return found[0].of(returns), Echoes.joined([rooms, *found[1:]])


def _in_crowns(uniform: Float32Array) -> tuple[Float32Array, Float32Array]:
    """(L,) shares of beams that pass between leaves, and (L,) depths of the leaves hit, by (L, 2) random numbers."""
    gap: Float32Array = np.power(uniform[:, 0], 1.0 / load_materials().lidar_transmission[Material.FOLIAGE] - 1.0)
    depth_m: Float32Array = np.float32(-_LEAF_DEPTH_M) * np.log1p(-uniform[:, 1])
    return gap, depth_m


def _look_into(windows: Windows, hits: Hits, strength: Float32Array, depth_m: Float32Array) -> Echoes:
    """Echoes of rooms without curtains; replaces strengths and depths of the wall by those of panes."""
    pane = windows.ray
    cos_angle = hits.cos_angle[pane]
    glass, white = np.full(len(pane), Material.GLASS, np.uint8), np.full(len(pane), _MEAN_COLOR, np.uint32)
    strength[pane] = surface_strength(glass, cos_angle, white, 0.0) + windows.curtain * cos_angle
    tilt: Float32Array = np.maximum(cos_angle, np.float32(_MIN_COS))
    depth_m[pane] = windows.pane_m / tilt
    open_ = np.flatnonzero(windows.room > 0.0)
    range_m: Float32Array = hits.range_m[pane] + (windows.pane_m + windows.room_m) / tilt
    room: Float32Array = windows.room * cos_angle
    return Echoes(windows.ray[open_], range_m[open_], room[open_])


def edge_echoes(first: Echoes, count: int, channels: int, reach: float, uniform: Float32Array) -> Echoes:
    """The first echoes of beams, shared between both sides of the edges that cut them.

    Args:
        first: Echo of the first surface of each beam that meets one.
        count: Number of beams, column by column.
        channels: Number of beams in a column.
        reach: Half the width of a beam, divided by the distance to the next one of its channel.
        uniform: (count,) uniform random numbers: where the edge lies between a beam and the next one.
    """
    range_m, strength = np.full(count, np.inf, np.float32), np.zeros(count, np.float32)
    range_m[first.ray], strength[first.ray] = first.range_m, first.strength
    left = np.arange(count - channels)
    with np.errstate(invalid="ignore"):
        jump_m = np.abs(range_m[left] - range_m[left + channels])
    left = left[jump_m > _MIN_JUMP_M]
    here, parts = np.ones(count, np.float32), []
    for of, other, edge in ((left, left + channels, uniform[left]), (left + channels, left, 1.0 - uniform[left])):
        share = np.maximum((reach - edge) / (2.0 * reach), 0.0).astype(np.float32)
        here[of] -= share
        parts.append(Echoes(of, range_m[other], share * strength[other]))
    own = Echoes(first.ray, first.range_m, first.strength * np.maximum(here[first.ray], 0.0))
    others = Echoes.joined(parts)
    seen = others.strength > 0.0
    return Echoes.joined([own, Echoes(others.ray[seen], others.range_m[seen], others.strength[seen])])


@lru_cache(maxsize=1)
def _ways_on() -> BoolArray:
    """(materials,) whether light passes a material or is mirrored by it."""
    table = load_materials()
    return (table.lidar_transmission > 0.0) | (table.lidar_mirror > 0.0)


def _mirrored(material: UInt8Array, cos_angle: Float32Array) -> Float32Array:
    """(N,) shares that panes and water mirror."""
    mirrored = load_materials().lidar_mirror.take(material)
    mirrors = np.flatnonzero(mirrored)
    mirrored[mirrors] += (1.0 - mirrored[mirrors]) * np.power(1.0 - cos_angle[mirrors], 5)
    return mirrored


def _colors(hits: Hits, actors: Table) -> UInt32Array:
    """(N,) colors of the actors that were hit; a mean one on static surfaces."""
    color = np.full(len(hits.row), _MEAN_COLOR, np.uint32)
    moving = np.flatnonzero(hits.row >= 0)
    color[moving] = actors["color"][hits.row[moving]]
    return color
