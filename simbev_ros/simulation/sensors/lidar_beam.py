"""Echoes along the beams of a lidar: through panes and leaves, in mirrors, and at edges that cut a beam.

Each beam first meets the surfaces that its ray hits. Clear glass and the gaps of leaves let a share pass, to what lies
behind them and back the same way. Panes and water mirror a share by Fresnel's law (Schlick's approximation); what it
meets then comes back the same way, so it seems to lie behind the mirror. Where neighboring rays of a channel end at
different ranges, an edge lies somewhere between them, and cuts those beams that are wide enough to reach it: they have
an echo of each side.
"""

from dataclasses import dataclass, replace

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
from simbev_ros.simulation.raycast.scene import Hits, RayScene
from simbev_ros.simulation.sensors.lidar_echo import surface_strength
from simbev_ros.simulation.sensors.lidar_texture import texture_factor
from simbev_ros.simulation.sensors.lidar_window import Windows, find_windows

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

    def times(self, factor: Float32Array) -> "Echoes":
        """The echoes with (M,) factors on their strengths."""
        return Echoes(self.ray, self.range_m, self.strength * factor)

    @classmethod
    def joined(cls, parts: list["Echoes"]) -> "Echoes":
        """The echoes of all parts."""
        columns = ([getattr(part, name) for part in parts] for name in ("ray", "range_m", "strength"))
        return cls(*map(np.concatenate, columns))


@dataclass(frozen=True, slots=True)
class Rays:
    """(N,) rays in the map frame.

    Attributes:
        origins_m: (N, 3) or (1, 3) origins.
        directions: (N, 3) unit vectors.
        lag_s: (N,) time before the tick; None: all at the tick.
    """

    origins_m: Float64Array
    directions: Float32Array
    lag_s: Float64Array | None


def surface_echoes(
    rays: Rays, hits: Hits, uniform: Float32Array, scene: RayScene, wetness: float, stretch: float, strongest: bool
) -> tuple[Echoes, Echoes]:
    """Echoes of the surfaces that beams meet first, of strength 0 for none, and of what they meet through and in these.

    Args:
        rays: The beams.
        hits: (N,) first hits.
        uniform: (N, 2) uniform random numbers.
        scene: What the beams meet.
        wetness: 0 dry to 1 wet.
        stretch: Angle of the beam divided by half the length of a pulse, 1/m. The echo of a surface that the beam hits
            at a slant is as long as the spot is deep, and its peak lower.
        strongest: Whether to leave out what would be weaker than the surface in front of it, were it white and matte.
    """
    windows, there = find_windows(scene, hits), np.isfinite(hits.range_m)
    # Most beams return, so the others take part at first, without light: this copies less than leaving them out.
    hits = replace(hits, range_m=np.where(there, hits.range_m, np.float32(0.0)))
    ray, share, before_m = np.arange(len(there)), there.astype(np.float32), np.zeros(len(there), np.float32)
    origins_m, directions, found = rays.origins_m, rays.directions, []
    for number in range(_MAX_PANES):
        path_m, depth_m = before_m + hits.range_m, np.zeros(len(ray), np.float32)
        strength = surface_strength(hits.material, hits.cos_angle, _colors(hits, scene.actors), wetness)
        slant2 = 1.0 / np.square(np.maximum(hits.cos_angle, _MIN_COS)) - 1.0
        strength *= share / np.sqrt(1.0 + np.square(np.float32(stretch) * path_m) * slant2)
        strength *= texture_factor(hits, _points_m(origins_m, directions, hits.range_m))
        if number == 0:
            rooms = _look_into(windows, hits, strength, depth_m)
        leaves = np.flatnonzero(hits.material == Material.FOLIAGE)
        gap, depth_m[leaves] = _in_crowns(uniform[ray[leaves]])
        strength[leaves] *= 1.0 - gap
        found.append(Echoes(ray, path_m + depth_m, strength))
        if number == _MAX_PANES - 1:
            break
        weakest = np.maximum(strength, _MIN_SHARE) if strongest else np.full(len(ray), np.float32(_MIN_SHARE))
        row, share, mirrors = _onward(hits, share, gap, weakest, number == 0)
        if not len(row):
            break
        directions = directions.take(row, axis=0)
        starts_m = origins_m if len(origins_m) == 1 else origins_m.take(row, axis=0)
        starts_m = starts_m + directions * hits.range_m.take(row)[:, None]
        directions += 2.0 * (hits.cos_angle.take(row) * mirrors)[:, None] * hits.normal.take(row, axis=0)
        origins_m = starts_m + _CLEARANCE_M * directions
        ray, before_m = ray.take(row), path_m.take(row)
        hits = scene.cast(origins_m, directions, None if rays.lag_s is None else rays.lag_s[ray])
        rows = np.flatnonzero(np.isfinite(hits.range_m))
        hits, ray, share, before_m = hits.of(rows), ray.take(rows), share.take(rows), before_m.take(rows) + _CLEARANCE_M
        origins_m, directions = origins_m.take(rows, axis=0), directions.take(rows, axis=0)
    return found[0], Echoes.joined([rooms, *found[1:]])


def _points_m(origins_m: Float64Array, directions: Float32Array, range_m: Float32Array) -> Float32Array:
    """(N, 3) points that were hit, map frame."""
    starts_m = origins_m.T.astype(np.float32)
    return np.stack([along * range_m + start_m for along, start_m in zip(directions.T, starts_m, strict=True)]).T


def _onward(
    hits: Hits, share: Float32Array, gap: Float32Array, weakest: Float32Array, by_mirrors: bool
) -> tuple[Int64Array, Float32Array, BoolArray]:
    """(K,) beams that pass what they hit, or are mirrored, with a share above the weakest; which are mirrored."""
    table = load_materials()
    rows = np.flatnonzero(((table.lidar_transmission > 0.0) | (table.lidar_mirror > 0.0)).take(hits.material))
    material, share, weakest = hits.material.take(rows), share.take(rows), weakest.take(rows)
    passing, mirrored = table.lidar_transmission.take(material), _mirrored(material, hits.cos_angle.take(rows))
    passing[material == Material.FOLIAGE] = gap
    passed, turned = np.square((1.0 - mirrored) * passing) * share, np.square(mirrored) * share
    ahead = np.flatnonzero(passed > weakest)
    back = np.flatnonzero(turned > weakest) if by_mirrors else ahead[:0]
    return (
        rows.take(np.concatenate([ahead, back])),
        np.concatenate([passed.take(ahead), turned.take(back)]),
        np.arange(len(ahead) + len(back)) >= len(ahead),
    )


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


def edge_echoes(first: Echoes, channels: int, reach: float, uniform: Float32Array) -> tuple[Echoes, Echoes]:
    """What edges leave of the first echoes of the beams that they cut, and echoes of their other sides.

    Args:
        first: Echo of the first surface of each of N beams, column by column; of strength 0 at 0 m for none.
        channels: Number of beams in a column.
        reach: Half the width of a beam, divided by the distance to the next one of its channel.
        uniform: (N,) uniform random numbers: where the edge lies between a beam and the next one; NaN for no edge.
    """
    range_m, strength = first.range_m, first.strength
    left = np.flatnonzero(np.abs(range_m[:-channels] - range_m[channels:]) > _MIN_JUMP_M)
    right, edge = left + channels, uniform[left]
    here, parts = np.ones(len(range_m), np.float32), []
    for of, other, away in ((left, right, edge), (right, left, 1.0 - edge)):
        cut = np.flatnonzero(away < reach)
        of, other, share = of[cut], other[cut], ((reach - away[cut]) / (2.0 * reach)).astype(np.float32)
        here[of] -= share
        parts.append(Echoes(of, range_m[other], share * strength[other]))
    return first.times(np.maximum(here, 0.0)), Echoes.joined(parts)


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
