"""Echoes that reach a radar by way of a wall: ghosts of objects at places where nothing is.

A ray that hits a flat wall goes on from there as from a mirror. The object that it meets is heard on three paths, with
the lengths a to the wall, b from the wall to the object, and c from the object straight to the radar:

* wall, object, wall: range a + b in the direction of the wall, which is the object's mirror image;
* wall, object, radar, and the same backwards: range (a + b + c) / 2, in the direction of the object and in that of the
  wall.

The speed is the rate of the range. The power is that of the radar equation with the lengths there and back, less what
each reflection on the wall takes. From one direction into another, a surface reflects as along their bisector and back
(Kell 1965). Surfaces that move or are curved mirror nothing, and no path has two walls.
"""

from typing import NamedTuple

import numpy as np

from simbev_ros.config.radar import Radar
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.raycast.scene import Hits, RayScene
from simbev_ros.simulation.sensors.radar_amplitude import CrossSections, areas_m2

_CLEARANCE_M = 1e-3
_SAME_M = 0.05
"""Distance within which two rays have hit the same point."""


class Scan(NamedTuple):
    """The N rays of a scan, and what they hit.

    Attributes:
        map_from_radar: (4, 4) pose of the radar.
        velocity_mps: (3,) velocity of the radar, map axes.
        directions: (N, 3) unit vectors, map axes.
        hits: Their hits.
        ray_sr: Solid angle of each ray.
    """

    map_from_radar: Float64Array
    velocity_mps: Float64Array
    directions: Float64Array
    hits: Hits
    ray_sr: float


class Echoes(NamedTuple):
    """M echoes.

    Attributes:
        section_m2: (M,) cross-sections, less what walls take from them.
        spread_m: (M,) ranges of the radar equation: square roots of the products of the lengths there and back.
        range_m: (M,) ranges that the radar measures.
        speed_mps: (M,) rates of these ranges.
        directions: (M, 3) unit vectors to where they seem to be, map axes.
    """

    section_m2: Float64Array
    spread_m: Float64Array
    range_m: Float64Array
    speed_mps: Float64Array
    directions: Float64Array


def trace_ghosts(
    radar: Radar, sections: CrossSections, scene: RayScene, scan: Scan, previous: WorldState | None
) -> Echoes:
    """Echoes by way of one wall, on each of the three paths; some are out of the radar's range.

    Args:
        radar: The radar.
        sections: Cross-sections and mirrors.
        scene: What the rays were cast into.
        scan: The rays.
        previous: World state one tick ago, for the motion of wheels and limbs; None: they move with their bodies.
    """
    radar_m = scan.map_from_radar[:3, 3]
    wall = scan.hits.of(ray := _rays_on_mirrors(sections, scan.hits, radar.range_m))
    there, normal = scan.directions[ray], wall.normal.astype(np.float64)
    wall_m = radar_m + there * wall.range_m[:, None].astype(np.float64)
    onward = there - 2.0 * np.einsum("ni,ni->n", there, normal)[:, None] * normal
    hits = scene.cast(wall_m + _CLEARANCE_M * normal, onward)
    met = np.flatnonzero(wall.range_m + hits.range_m <= radar.range_m)
    wall, hits, there, onward, wall_m = wall.of(met), hits.of(met), there[met], onward[met], wall_m[met]
    points_m = wall_m + onward * hits.range_m[:, None].astype(np.float64)
    path_m = wall.range_m.astype(np.float64) + hits.range_m
    velocity_mps = scene.velocities(hits, points_m, previous)
    rate_mps = np.einsum("ni,ni->n", velocity_mps, onward) - there @ scan.velocity_mps
    cos_angle = hits.cos_angle.astype(np.float64)
    area_m2 = areas_m2(scan.ray_sr, path_m, cos_angle)
    mirrored = sections.mirror[wall.material]
    image = Echoes(sections.per_m2(hits.material, cos_angle) * area_m2 * mirrored**2, path_m, path_m, rate_mps, there)

    straight_m = np.linalg.norm(points_m - radar_m, axis=1)
    straight = (points_m - radar_m) / straight_m[:, None]
    bisector = -(onward + straight)
    bisector /= np.maximum(np.linalg.norm(bisector, axis=1), 1e-9)[:, None]
    cos_bisector = np.einsum("ni,ni->n", bisector, hits.normal.astype(np.float64))
    seen = np.flatnonzero(_are_in_view(radar, straight @ scan.map_from_radar[:3, :3]) & (cos_bisector > 0.0))
    seen = seen[np.abs(scene.cast(radar_m[None], straight[seen]).range_m - straight_m[seen]) < _SAME_M]
    halves = Echoes(
        (sections.per_m2(hits.material, cos_bisector) * area_m2 * mirrored)[seen],
        np.sqrt(path_m * straight_m)[seen],
        (path_m + straight_m)[seen] / 2.0,
        (rate_mps + np.einsum("ni,ni->n", velocity_mps - scan.velocity_mps, straight))[seen] / 2.0,
        straight[seen],
    )
    return Echoes(*map(np.concatenate, zip(image, halves, halves._replace(directions=there[seen]), strict=True)))


def _rays_on_mirrors(sections: CrossSections, hits: Hits, range_m: float) -> Int64Array:
    """Indices of the rays that hit something flat and mirroring that stands still, within a range."""
    mirrors = sections.is_flat[hits.tag] & (sections.mirror[hits.material] > 0.0)
    return np.flatnonzero(mirrors & (hits.row < 0) & (hits.range_m < range_m))


def _are_in_view(radar: Radar, directions: Float64Array) -> BoolArray:
    """(N,) whether (N, 3) unit vectors in the sensor frame are in the field of view."""
    half_rad = np.radians([radar.horizontal_fov_deg, radar.vertical_fov_deg]) / 2.0
    azimuth_rad, sine = np.arctan2(directions[:, 1], directions[:, 0]), np.abs(directions[:, 2])
    in_view: BoolArray = (np.abs(azimuth_rad) <= half_rad[0]) & (sine <= np.sin(half_rad[1]))
    return in_view
