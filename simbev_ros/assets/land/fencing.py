"""Puts fences, walls and hedges along lines, in whole panels where there is room."""

from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.land.yard import Yard, quads, yaw_of
from simbev_ros.assets.mesh.graded import GradedMesh
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.ensemble import Base
from simbev_ros.assets.street.barriers import PANEL_M, VARIANTS, panel
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land_features import BARRIER_KINDS

_HALF_WIDTH_M = {"hedge": 0.42, "high_hedge": 0.42}
_THIN_M = 0.2


def fence_line(
    yard: Yard, kind: str, start_m: Float64Array, end_m: Float64Array, land: BaseGeometry, rng: np.random.Generator
) -> None:
    """Put generated panels along a line as ``put_panels`` does, unless the map prescribes the fences around it."""
    variant = int(rng.integers(VARIANTS))
    if not yard.map_objects.replace(BARRIER_KINDS, start_m[None])[0]:
        put_panels(yard, panel(kind, variant, yard.ground.season), kind, start_m, end_m, land)


def put_panels(
    yard: Yard,
    mesh: Mesh | GradedMesh,
    kind: str,
    start_m: Float64Array,
    end_m: Float64Array,
    land: BaseGeometry,
    clear: tuple[shapely.STRtree, float] | None = None,
    base: Base = Base.ALONG_LAND,
) -> None:
    """Put panels along a straight line between two (2,) points, where they are free and on the land.

    ``clear``: what they keep clear of, and the distance in meters. ``base``: what they stand on.
    """
    step = end_m - start_m
    length_m = float(np.hypot(*step))
    count = int(length_m / PANEL_M[kind])
    if count == 0:
        return
    along, half_m = step / length_m, _HALF_WIDTH_M.get(kind, _THIN_M)
    first_m = start_m + along * (length_m - count * PANEL_M[kind]) / 2.0
    positions = first_m + np.outer(np.arange(count) * PANEL_M[kind], along)
    footprints = quads(positions, np.tile(along, (count, 1)), (0.01, PANEL_M[kind] - 0.01), (-half_m, half_m))
    fit = shapely.contains(land, footprints) & shapely.contains(yard.inside, footprints)
    if clear is not None:
        near, _ = clear[0].query(footprints, predicate="dwithin", distance=clear[1])
        fit[near] = False
    kept = [k for k in np.flatnonzero(fit).tolist() if yard.claims.is_free(footprints[k])]
    yard.claims.add(*(footprints[k] for k in kept))
    yard.ensemble.put(mesh, positions[kept], yaw_of(along), base=base)


def fence_along(yard: Yard, kind: str, line: shapely.LineString, land: BaseGeometry, rng: np.random.Generator) -> None:
    """Put panels of a kind along a polyline, like ``fence_line`` along each of its segments."""
    corners = shapely.get_coordinates(line.simplify(0.3))
    for start_m, end_m in pairwise(corners):
        fence_line(yard, kind, start_m, end_m, land, rng)
