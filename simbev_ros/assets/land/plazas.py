"""Plazas: paved areas that pedestrians visit, with the paths that lead there from sidewalks."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.land.covers import PATH_RISE_M
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.street.obstacles import obstacle_corners_m
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.maps.land.membrane import Raster

_BODY_M = 0.5  # half of a pedestrian's width, and some clearance
_MOUTH_M, _SIDEWALK_M = (
    1.0,
    5.0,
)  # maximum gap between path and sidewalk; radius of the sidewalk around it that belongs to the plaza
_SEAM_M = 0.05  # closes gaps between areas on millimeter grids
_MARGIN_M = 4.0


@dataclass(frozen=True, slots=True)
class Pavement:
    """A paved plaza while its region is laid out; ``plazas_of`` turns reachable ones into ``Plaza``.

    Attributes:
        area: Area of the plaza and its paths, map frame.
        paths_m: (W, 2, 2) lines from the street's edge, along the middle of a path, to the plaza.
    """

    area: BaseGeometry
    paths_m: Float64Array


@dataclass(frozen=True, slots=True)
class Plaza:
    """A plaza as the simulation of pedestrians uses it.

    Attributes:
        free: Area where the centers of pedestrians may be, map frame: the plaza, its paths and the sidewalks beside
            them, clear of all obstacles.
        paths_m: (W, 2, 2) lines from the sidewalk, along the middle of a path, to the plaza.
        ground: Heights of the paving.
    """

    free: BaseGeometry
    paths_m: Float64Array
    ground: Raster


def plazas_of(
    pavements: Sequence[Pavement], ground: RegionGround, placed_objects: Sequence[tuple[Mesh, Float64Array]]
) -> tuple[Plaza, ...]:
    """Plazas of a region that pedestrians can reach from a sidewalk.

    Args:
        pavements: Paved areas of the region.
        ground: Ground of the region.
        placed_objects: Possible obstacles: upright meshes, and the (N, 4, 4) poses of their copies, map frame.
    """
    sidewalk = ground.streets[0].sidewalk
    reachable = []
    for pavement in pavements:
        mouths = shapely.points(pavement.paths_m[:, 0])
        paths_m = pavement.paths_m[shapely.dwithin(mouths, sidewalk, _MOUTH_M) & ground.owns(pavement.paths_m[:, 0])]
        if len(paths_m):
            beside = overlay.intersection(sidewalk, shapely.MultiPoint(paths_m[:, 0]).buffer(_SIDEWALK_M))
            seamless = shapely.buffer([pavement.area, beside], _SEAM_M)
            reachable.append((shapely.buffer(overlay.union_all(seamless), -_SEAM_M - _BODY_M), paths_m))
    grounds = [_ground(ground, area) for area, _ in reachable]
    obstacles = _obstacles([area for area, _ in reachable], grounds, placed_objects)
    return tuple(
        Plaza(overlay.difference(area, things), paths_m, heights)
        for (area, paths_m), heights, things in zip(reachable, grounds, obstacles, strict=True)
        if not area.is_empty
    )


def _obstacles(
    areas: Sequence[BaseGeometry], grounds: Sequence[Raster], placed_objects: Sequence[tuple[Mesh, Float64Array]]
) -> list[BaseGeometry]:
    """For each area, the area around obstacles that pedestrians keep clear of."""
    found: list[list[BaseGeometry]] = [[] for _ in areas]
    tree = shapely.STRtree(list(areas))
    for mesh, poses in placed_objects if areas else ():
        reach_m = float(np.linalg.norm(mesh.vertices[:, :2], axis=1).max(initial=0.0)) + _BODY_M
        scale = np.linalg.norm(poses[:, :3, 0], axis=1)
        near, area = tree.query(shapely.points(poses[:, :2, 3]), predicate="dwithin", distance=reach_m * scale)
        for pose, index in zip(poses[near], area.tolist(), strict=True):
            above_m = pose[2, 3] - grounds[index].linear(pose[None, :2, 3])[0]
            plan_m = obstacle_corners_m(mesh, above_m)[:, :2] @ pose[:2, :2].T + pose[:2, 3]
            found[index].append(shapely.convex_hull(shapely.MultiPoint(plan_m)))
    return [shapely.buffer(overlay.union_all(hulls), _BODY_M, quad_segs=3) for hulls in found]


def _ground(ground: RegionGround, area: BaseGeometry) -> Raster:
    """Heights of the paving around an area."""
    west, south, east, north = shapely.buffer(area, _MARGIN_M).bounds
    land = ground.land_raster(np.array([west, south]), np.array([east, north]))
    return Raster(land.origin_m, land.spacing_m, land.values + PATH_RISE_M)


def plaza_arrays(plazas: Sequence[Plaza]) -> Iterator[tuple[str, AnyArray]]:
    """Named flat arrays of plazas, for NPZ files."""
    yield "plaza_free", np.array([shapely.to_wkb(plaza.free, hex=True) for plaza in plazas], np.bytes_)
    yield "plaza_ways", np.array([len(plaza.paths_m) for plaza in plazas], np.int64)
    yield "plaza_way_m", np.concatenate([np.empty((0, 2, 2)), *(plaza.paths_m for plaza in plazas)])
    grounds = [plaza.ground for plaza in plazas]
    yield "plaza_lattice", np.array([(*each.origin_m, each.spacing_m) for each in grounds]).reshape(-1, 3)
    yield "plaza_nodes", np.array([each.values.shape for each in grounds], np.int64).reshape(-1, 2)
    yield "plaza_height_m", np.concatenate([np.empty(0), *(each.values.ravel() for each in grounds)])


def plazas_from(arrays: Mapping[str, AnyArray]) -> tuple[Plaza, ...]:
    """Plazas from the arrays of ``plaza_arrays``."""
    paths_m = np.split(arrays["plaza_way_m"], np.cumsum(arrays["plaza_ways"])[:-1])
    nodes = arrays["plaza_nodes"]
    heights_m = np.split(arrays["plaza_height_m"], np.cumsum(nodes.prod(axis=1))[:-1])
    each = zip(arrays["plaza_free"].tolist(), paths_m, arrays["plaza_lattice"], nodes, heights_m, strict=False)
    return tuple(
        Plaza(shapely.from_wkb(free), own_m, Raster(lattice[:2], float(lattice[2]), height_m.reshape(shape)))
        for free, own_m, lattice, shape, height_m in each
    )
