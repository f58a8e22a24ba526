"""Land around the buildings: garden paths, hedges, fences and walls, trees and bushes, parks with paths, benches, ponds."""

import numpy as np
import shapely

from simbev_ros.assets.building_sites import SHOULDER_ROOM_M, Site
from simbev_ros.assets.claims import Claims
from simbev_ros.assets.facades import door_x_m
from simbev_ros.assets.furniture import bench, fence, garden_wall
from simbev_ros.assets.ground import LAND_HEIGHT_M, YARD
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.palette import pick_color
from simbev_ros.assets.plants import Grove, hedge
from simbev_ros.assets.ponds import pond
from simbev_ros.assets.primitives import plate
from simbev_ros.assets.tiles import TileBuilder
from simbev_ros.assets.town_plan import Block, BlockUse, TownPlan, front_sides
from simbev_ros.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.scene.random import stream
from simbev_ros.types import Float64Array

_PATH_RISE_M = 0.01
_PATH_WIDTH_M, _PARK_PATH_WIDTH_M = 1.3, 2.6
_PLAZA_RADIUS_M = 7.0
_WOODS_DEPTH_M = 60.0
_M2_PER_TREE = {BlockUse.PARK: 60.0, BlockUse.RESIDENTIAL: 130.0, BlockUse.DOWNTOWN: 170.0, BlockUse.OUTSKIRTS: 190.0}
_KINDS = {
    BlockUse.PARK: ("round", "round", "tall", "small", "bush", "bush", "conifer"),
    BlockUse.RESIDENTIAL: ("round", "small", "small", "bush", "bush", "conifer"),
    BlockUse.DOWNTOWN: ("round", "small", "bush"),
    BlockUse.OUTSKIRTS: ("round", "tall", "conifer", "conifer", "bush"),
}
_ROOM_M = {"round": 2.4, "tall": 2.0, "small": 1.5, "conifer": 2.6, "bush": 0.8}
_BARRIER_M = 0.45


def lay_out_gardens(
    tiles: TileBuilder, claims: Claims, plan: TownPlan, sites: tuple[Site, ...], plant_density: float, seed: int
) -> None:
    """Add all that stands or lies on the land besides buildings."""
    rng = stream(seed, "surroundings.gardens")
    grove = Grove(rng)
    paths = [_front_path(site) for site in sites]
    for block in plan.blocks:
        if block.use is BlockUse.PARK:
            paths.append(_park(tiles, claims, block, rng))
    land = shapely.union_all([block.land for block in plan.blocks if block.use is not BlockUse.DOWNTOWN])
    paving = shapely.intersection(shapely.union_all(paths), land)
    tiles.cover(paving, lambda piece: plate(YARD, piece, LAND_HEIGHT_M + _PATH_RISE_M))
    claims.add(shapely.union_all([_front_path(site) for site in sites if site.style == "house"]).buffer(0.2))
    for site in sites:
        if site.style == "house":
            _fence_in(tiles, claims, site, land, rng)
    for block in plan.blocks:
        _plant(tiles, claims, block, grove, plant_density, rng)


def _front_path(site: Site) -> shapely.Polygon:
    """Paving from the sidewalk to the front: a path to a house's door, a forecourt before all else."""
    half_m = site.plot.width_m / 2.0
    x_m = door_x_m(site.plot.width_m)
    span = (x_m - _PATH_WIDTH_M / 2.0, x_m + _PATH_WIDTH_M / 2.0) if site.style == "house" else (-half_m, half_m)
    reach_m = site.setback_m + SHOULDER_ROOM_M + 0.2
    return _in_map(site, np.array([[span[0], -reach_m], [span[1], -reach_m], [span[1], 0.0], [span[0], 0.0]]))


def _in_map(site: Site, corners_m: Float64Array) -> shapely.Polygon:
    return shapely.Polygon(corners_m @ site.map_from_building[:2, :2].T + site.map_from_building[:2, 3])


def _fence_in(tiles: TileBuilder, claims: Claims, site: Site, land: shapely.Geometry, rng: np.random.Generator) -> None:
    """A hedge, a fence or a wall along the front of a house's garden, open at the path."""
    kind, color = ("hedge", "fence", "wall", "none")[int(rng.integers(4))], pick_color(rng, "walls_low")
    y_m = -(site.setback_m + SHOULDER_ROOM_M) + 0.55
    door_m, half_m = door_x_m(site.plot.width_m), site.plot.width_m / 2.0 + 0.5
    for start_m, end_m in ((-half_m, door_m - 1.1), (door_m + 1.1, half_m)):
        length_m = end_m - start_m
        reach = np.array([[start_m, y_m - 0.4], [end_m, y_m - 0.4], [end_m, y_m + 0.4], [start_m, y_m + 0.4]])
        footprint = _in_map(site, reach)
        if kind == "none" or length_m < 1.5 or not land.contains(footprint) or not claims.claim(footprint):
            continue
        offset = np.eye(4)
        offset[:2, 3] = start_m, y_m
        tiles.place(_barrier(kind, length_m, color, rng), site.map_from_building @ offset)


def _barrier(kind: str, length_m: float, color: tuple[int, int, int], rng: np.random.Generator) -> Mesh:
    if kind == "hedge":
        return hedge(rng, length_m)
    return fence(length_m) if kind == "fence" else garden_wall(length_m, color)


def _park(tiles: TileBuilder, claims: Claims, block: Block, rng: np.random.Generator) -> shapely.Polygon:
    """Benches, hedge and pond of a park; returns its paths, from the middle of each side to a round place."""
    middle = block.land.centroid
    gates = [side.start_m + side.direction * side.length_m / 2.0 for side in front_sides(block, 30.0)]
    spokes = [shapely.LineString([gate, middle.coords[0]]) for gate in gates]
    paths = shapely.union_all(
        [middle.buffer(_PLAZA_RADIUS_M), *(spoke.buffer(_PARK_PATH_WIDTH_M / 2.0) for spoke in spokes)]
    )
    claims.add(paths.buffer(0.15))
    water = _pond_outline(block, rng)
    if block.land.buffer(-3.0).contains(water) and claims.claim(water.buffer(1.0)):
        tiles.place(*pond(water))
    for spoke in spokes:
        _put_benches(tiles, claims, spoke)
    for side in front_sides(block, 12.0):
        yaw_rad = float(np.arctan2(side.direction[1], side.direction[0]))
        inward = np.array([-side.direction[1], side.direction[0]])
        for s_m in np.arange(2.0, side.length_m - 8.0, 6.2):
            start = side.start_m + side.direction * s_m + inward * 0.9
            line = shapely.LineString([start, start + side.direction * 6.0]).buffer(_BARRIER_M)
            if claims.claim(line):
                pose = matrices_from_xyz_rpy(np.array([*start, LAND_HEIGHT_M]), np.array([0.0, 0.0, yaw_rad]))
                tiles.place(hedge(rng, 6.0), pose)
    return paths


def _pond_outline(block: Block, rng: np.random.Generator) -> shapely.Polygon:
    """An irregular round, between the middle of a park and one of its corners."""
    x0, y0, x1, y1 = block.land.bounds
    corner = np.array([(x0, x1)[int(rng.integers(2))], (y0, y1)[int(rng.integers(2))]])
    center = np.array(block.land.centroid.coords[0]) * 0.5 + corner * 0.5
    angles = np.arange(28) * (2.0 * np.pi / 28)
    radius = 9.0 + 1.6 * np.sin(2.0 * angles + rng.uniform(0, 6)) + 0.8 * np.sin(3.0 * angles + rng.uniform(0, 6))
    return shapely.Polygon(center + radius[:, None] * np.column_stack([1.2 * np.cos(angles), np.sin(angles)]))


def _put_benches(tiles: TileBuilder, claims: Claims, spoke: shapely.LineString) -> None:
    """Benches on the left of a park's path, facing it."""
    for s_m in np.arange(6.0, spoke.length - _PLAZA_RADIUS_M, 14.0):
        (x0, y0), (x1, y1) = (spoke.interpolate(s).coords[0] for s in (s_m, s_m + 0.1))
        along = np.array([x1 - x0, y1 - y0]) / np.hypot(x1 - x0, y1 - y0)
        place = np.array([x0, y0]) + np.array([-along[1], along[0]]) * (_PARK_PATH_WIDTH_M / 2.0 + 1.2)
        if claims.claim(shapely.Point(*place).buffer(0.95, quad_segs=4)):
            yaw_rad = float(np.arctan2(-along[0], along[1]))
            tiles.place(
                bench(), matrices_from_xyz_rpy(np.array([*place, LAND_HEIGHT_M]), np.array([0.0, 0.0, yaw_rad]))
            )


def _plant(
    tiles: TileBuilder, claims: Claims, block: Block, grove: Grove, density: float, rng: np.random.Generator
) -> None:
    """Trees and bushes at random places that are free."""
    ground = block.land.buffer(-1.2)
    if block.use is BlockUse.OUTSKIRTS:
        streets = shapely.union_all([shapely.Polygon(ring) for ring in block.frontage])
        ground = ground.intersection(streets.buffer(_WOODS_DEPTH_M))
    x0, y0, x1, y1 = ground.bounds
    count = int(density * (x1 - x0) * (y1 - y0) / _M2_PER_TREE[block.use])
    places = rng.uniform((x0, y0), (x1, y1), (count, 2))
    shapely.prepare(ground)
    for place in places[shapely.contains_xy(ground, places)]:
        kind = _KINDS[block.use][int(rng.integers(len(_KINDS[block.use])))]
        if claims.claim(shapely.Point(*place).buffer(_ROOM_M[kind], quad_segs=4)):
            tiles.place(*grove.plant(kind, np.array([*place, LAND_HEIGHT_M])))
