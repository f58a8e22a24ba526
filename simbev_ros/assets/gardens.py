"""What lies before the buildings: paths and forecourts; hedges, fences and walls of front gardens."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.building_sites import SHOULDER_ROOM_M, Site
from simbev_ros.assets.claims import Claims
from simbev_ros.assets.facades import door_x_m
from simbev_ros.assets.furniture import fence, garden_wall
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.palette import Color, pick_color
from simbev_ros.assets.plants import hedge
from simbev_ros.assets.tiles import TileBuilder
from simbev_ros.random import stream
from simbev_ros.types import Float64Array

_PATH_WIDTH_M = 1.3
_GATE_M = 1.1
_SHORTEST_BARRIER_M = 1.5


def lay_out_front_gardens(
    tiles: TileBuilder, claims: Claims, sites: Sequence[Site], land: BaseGeometry, seed: int
) -> BaseGeometry:
    """Add the barriers of the houses' gardens; returns what is paved before all buildings."""
    rng = stream(seed, "surroundings.gardens")
    houses = [site for site in sites if site.style == "house"]
    claims.add(shapely.union_all([_front_path(site) for site in houses]).buffer(0.2))
    for site in houses:
        _fence_in(tiles, claims, site, land, rng)
    return shapely.union_all([_front_path(site) for site in sites])


def _front_path(site: Site) -> shapely.Polygon:
    """Paving from the sidewalk to the front: a path to a house's door, a forecourt before all else."""
    half_m = site.plot.width_m / 2.0
    x_m = door_x_m(site.plot.width_m)
    span = (x_m - _PATH_WIDTH_M / 2.0, x_m + _PATH_WIDTH_M / 2.0) if site.style == "house" else (-half_m, half_m)
    reach_m = site.setback_m + SHOULDER_ROOM_M + 0.2
    return _in_map(site, np.array([[span[0], -reach_m], [span[1], -reach_m], [span[1], 0.0], [span[0], 0.0]]))


def _in_map(site: Site, corners_m: Float64Array) -> shapely.Polygon:
    return shapely.Polygon(corners_m @ site.map_from_building[:2, :2].T + site.map_from_building[:2, 3])


def _fence_in(tiles: TileBuilder, claims: Claims, site: Site, land: BaseGeometry, rng: np.random.Generator) -> None:
    """A hedge, a fence or a wall along the front of a house's garden, open at the path."""
    kind, color = ("hedge", "fence", "wall", "none")[int(rng.integers(4))], pick_color(rng, "walls_low")
    y_m = -(site.setback_m + SHOULDER_ROOM_M) + 0.55
    door_m, half_m = door_x_m(site.plot.width_m), site.plot.width_m / 2.0 + 0.5
    for start_m, end_m in ((-half_m, door_m - _GATE_M), (door_m + _GATE_M, half_m)):
        length_m = end_m - start_m
        reach = np.array([[start_m, y_m - 0.4], [end_m, y_m - 0.4], [end_m, y_m + 0.4], [start_m, y_m + 0.4]])
        footprint = _in_map(site, reach)
        if (
            kind == "none"
            or length_m < _SHORTEST_BARRIER_M
            or not land.contains(footprint)
            or not claims.claim(footprint)
        ):
            continue
        offset = np.eye(4)
        offset[:2, 3] = start_m, y_m
        tiles.place(_barrier(kind, length_m, color, rng), site.map_from_building @ offset)


def _barrier(kind: str, length_m: float, color: Color, rng: np.random.Generator) -> Mesh:
    if kind == "hedge":
        return hedge(rng, length_m)
    return fence(length_m) if kind == "fence" else garden_wall(length_m, color)
