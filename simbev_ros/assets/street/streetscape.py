"""Furnishes the streets of a region: traffic lights, signs, bus shelters, name signs, trees, small objects, cables."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely

from simbev_ros.assets.flora.species import draw_species, reach_m
from simbev_ros.assets.land.blocks import Block, Zones
from simbev_ros.assets.land.planting import has_room, plant
from simbev_ros.assets.land.yard import Yard, yaw_of
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box
from simbev_ros.assets.palette import pick_color
from simbev_ros.assets.placement.ensemble import Base
from simbev_ros.assets.placement.nearby_objects import TREE_KINDS
from simbev_ros.assets.placement.tiles import upright_pose
from simbev_ros.assets.street.curbs import STATION_M, CurbLine
from simbev_ros.assets.street.furniture import bench, bicycle_rack, bus_shelter, cabinet, hydrant, litter_bin
from simbev_ros.assets.street.poles import cables, utility_pole
from simbev_ros.assets.street.signal_poles import signal_poles
from simbev_ros.assets.street.signs import sign_mesh, street_name_sign
from simbev_ros.assets.street.surface import surface_m
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land_features import ObjectKind
from simbev_ros.maps.roads.lane_kind import LaneKind

_SHELTERED_SHARE = 0.2
_SMALL_THINGS_M = 20.0
_TREE_LINED_SHARE, _TREE_ROOM_M = 0.68, 1.1
_MEDIAN_M, _MEDIAN_SPACING, _CLEAR_OF_END_M = 2.6, 1.5, 14.0
_POLE_SPACING_M = 42.0
_POLED_USES, _POLED_STREETS = ("farmland", "suburb", "woods"), ("suburb", "residential")
_PIT = box(Finish(Material.SOIL, Tag.TERRAIN, (92, 76, 58)), (0.7, 1.4, 0.06), (0.0, 0.0, -0.018))


def put_signals(yard: Yard) -> None:
    """Put the traffic lights that stand in the region."""
    elevation = yard.ground.terrain.elevation
    for mesh, map_from_pole in signal_poles(yard.ground):
        yard.claims.add(shapely.Point(map_from_pole[:2, 3]).buffer(0.8, quad_segs=4))
        level = int(elevation.level_at(map_from_pole[None, :3, 3])[0])
        yard.tiles.place(mesh, map_from_pole, level)


def put_signs(yard: Yard) -> None:
    """Put the traffic signs of the map that stand in the region."""
    signs = yard.ground.network.layout.signs
    feet_m = np.array([sign.foot_m for sign in signs]).reshape(-1, 3)
    owned = np.flatnonzero(yard.ground.owns(feet_m[:, :2]))
    levels = yard.ground.terrain.elevation.level_at(feet_m[owned])
    for row, level in zip(owned.tolist(), levels.tolist(), strict=True):
        yard.claims.add(shapely.Point(feet_m[row, :2]).buffer(0.35, quad_segs=2))
        pose = upright_pose(feet_m[row, :2], float(feet_m[row, 2]), signs[row].yaw_rad)
        yard.tiles.place(sign_mesh(signs[row]), pose, level)


def put_bus_shelters(yard: Yard, blocks: Sequence[Block]) -> None:
    """Put bus shelters just behind the sidewalk, open to the street."""
    for block in blocks:
        if block.recipe.use in ("farmland", "woods"):
            continue
        rng = yard.ground.stream(f"shelters.{block.name}")
        for line in block.frontage:
            wanted = rng.random() < 2.0 * _SHELTERED_SHARE * block.recipe.furniture_density
            if not wanted or not line.walk or line.length_m < 60.0:
                continue
            position_m, along = line.chord(line.length_m * rng.uniform(0.25, 0.75), 4.0)
            position_m = position_m + left_of(along) * 1.1
            if yard.map_objects.replace((ObjectKind.BUS_SHELTER,), position_m[None])[0]:
                continue
            if yard.claim(shapely.Point(position_m).buffer(2.4, quad_segs=4), yard.inside):
                yard.ensemble.put(bus_shelter(), position_m, yaw_of(-left_of(along)))


def put_name_signs(yard: Yard, curbs: Sequence[CurbLine]) -> None:
    """Put street name signs at one corner of each junction that has sidewalks."""
    walks = [curb for curb in curbs if curb.walk and len(curb.position_m)]
    centers_m = np.array([junction.center_m[:2] for junction in yard.ground.network.junctions.values()]).reshape(-1, 2)
    centers_m = centers_m[yard.ground.owns(centers_m)]
    if not walks or len(centers_m) == 0:
        return
    positions_m, yaws_rad = (
        np.concatenate([getattr(curb, name) for curb in walks]) for name in ("position_m", "yaw_rad")
    )
    template = street_name_sign((28, 92, 64))
    for center_m in centers_m:
        distance_m = np.hypot(*(positions_m - center_m).T)
        for k in np.argsort(distance_m, kind="stable")[:12].tolist():
            if distance_m[k] < 40.0 and yard.claims.claim(shapely.Point(positions_m[k]).buffer(0.3, quad_segs=2)):
                yard.ensemble.put(template, positions_m[k], yaws_rad[k], base=Base.SIDEWALK)
                break


def put_street_trees(yard: Yard, curbs: Sequence[CurbLine]) -> None:
    """Plant avenues: trees in pits, one species per curb line, with crowns clear of buildings and traffic lights."""
    for number, curb in enumerate(curbs):
        rng = yard.ground.stream(f"street_trees.{number}")
        lined = rng.random() < _TREE_LINED_SHARE * min(1.0, 2.0 * curb.recipe.plant_density)
        if not curb.walk or not lined or curb.recipe.tree_spacing_m == 0.0:
            continue
        species = draw_species(curb.recipe.plants, "street", 1, rng)[0]
        chosen = np.arange(6, len(curb.position_m), max(1, round(curb.recipe.tree_spacing_m / STATION_M)))
        chosen = chosen[rng.random(len(chosen)) < 0.9]
        chosen = chosen[~yard.map_objects.replace(TREE_KINDS, curb.position_m[chosen])]
        crown_m = np.full(len(chosen), reach_m(species))
        chosen = chosen[has_room(yard, curb.position_m[chosen], crown_m, beside_street=True)]
        chosen = chosen[yard.claims.claim_discs(curb.position_m[chosen], np.full(len(chosen), _TREE_ROOM_M))]
        yard.ensemble.put(_PIT, curb.position_m[chosen], curb.yaw_rad[chosen], base=Base.SIDEWALK)
        plant(yard, species, curb.position_m[chosen], rng, Base.SIDEWALK)


def put_median_trees(yard: Yard, zones: Zones) -> None:
    """Plant a row of trees along the middle of green medians, clear of their ends."""
    ground = yard.ground
    green = shapely.buffer(ground.streets[0].median, -_MEDIAN_M / 2.0)
    shapely.prepare(green)
    for strip in ground.network.layout.near(ground.region.area, 0.0).strips_of(LaneKind.MEDIAN, level=0):
        line = shapely.LineString(strip.left_m[:, :2])
        rng = stream(ground.network.seed, f"median_trees.{strip.lane}")
        for recipe, area in zones:
            spacing_m = _MEDIAN_SPACING * recipe.tree_spacing_m
            if spacing_m == 0.0 or rng.random() > 2.0 * recipe.plant_density:
                continue
            at_m = np.arange(_CLEAR_OF_END_M, line.length - _CLEAR_OF_END_M, spacing_m)
            positions = shapely.get_coordinates(shapely.line_interpolate_point(line, at_m))
            positions = positions[shapely.contains_xy(green, positions) & shapely.contains_xy(area, positions)]
            species = draw_species(recipe.plants, "street", 1, rng)[0]
            positions = positions[~yard.map_objects.replace(TREE_KINDS, positions)]
            positions = positions[
                has_room(yard, positions, np.full(len(positions), reach_m(species)), beside_street=True)
            ]
            free = yard.claims.claim_discs(positions, np.full(len(positions), 0.4 * spacing_m))
            plant(yard, species, positions[free], rng, Base.SIDEWALK)


def put_small_things(yard: Yard, curbs: Sequence[CurbLine]) -> None:
    """Put bins, hydrants, benches, bicycle racks and cabinets where sidewalks still have room."""
    rng = yard.ground.stream("small_things")
    things: tuple[tuple[ObjectKind, Mesh, float, float], ...] = (
        (ObjectKind.BIN, litter_bin(pick_color(rng, "bins", 0.0)), 0.35, 0.8),
        (ObjectKind.HYDRANT, hydrant(), 0.3, 0.4),
        (ObjectKind.BENCH, bench(), 1.0, 0.8),
        (ObjectKind.BICYCLE_RACK, bicycle_rack(), 1.9, 0.5),
        (ObjectKind.CABINET, cabinet(), 0.6, 0.35),
    )
    for curb in curbs:
        if not curb.walk or curb.recipe.use in ("farmland", "woods"):
            continue
        every = round(_SMALL_THINGS_M / STATION_M)
        for start in range(0, len(curb.position_m), every):
            kind, mesh, radius_m, share = things[int(rng.integers(len(things)))]
            k = min(start + int(rng.integers(every)), len(curb.position_m) - 1)
            wanted = rng.random() < share * curb.recipe.furniture_density
            wanted = wanted and not yard.map_objects.replace((kind,), curb.position_m[k][None])[0]
            room = shapely.Point(curb.position_m[k]).buffer(radius_m, quad_segs=3)
            if wanted and yard.claim(room, yard.inside):
                yaw_rad = curb.yaw_rad[k] + (np.pi if kind is ObjectKind.BENCH else 0.0)  # one looks at the sidewalk
                yard.ensemble.put(mesh, curb.position_m[k], yaw_rad, base=Base.SIDEWALK)


def put_cables(yard: Yard, curbs: Sequence[CurbLine]) -> None:
    """Put utility poles with cables along one side of country roads and of quiet streets."""
    rng = yard.ground.stream("cables")
    every = round(_POLE_SPACING_M / STATION_M)
    taken = np.empty((0, 2))
    open_land = overlay.difference(yard.ground.land, yard.fast)
    shapely.prepare(open_land)
    for curb in curbs:
        wanted = rng.random() < (0.5 if curb.walk else 0.75)
        if (
            curb.level
            or curb.recipe.use not in (_POLED_STREETS if curb.walk else _POLED_USES)
            or len(curb.position_m) < 2 * every
            or not wanted
        ):
            continue
        outward = -np.stack([np.cos(curb.yaw_rad), np.sin(curb.yaw_rad)], axis=1)
        off_m = 0.0 if curb.walk else 1.8
        positions_m = (curb.position_m + off_m * outward)[every // 4 :: every]
        yaw_rad = curb.yaw_rad[every // 4 :: every]
        if len(taken) and np.hypot(*(taken[:, None] - positions_m).T).min() < _POLE_SPACING_M:
            continue  # the other side of the road already has poles
        if yard.map_objects.replace((ObjectKind.UTILITY_POLE,), positions_m).any():
            continue
        land, base = (yard.inside, Base.SIDEWALK) if curb.walk else (open_land, Base.LAND)
        free = [yard.claim(shapely.Point(position).buffer(0.3, quad_segs=2), land) for position in positions_m]
        yard.ensemble.put(utility_pole(), positions_m[free], yaw_rad[free], base=base)
        taken = np.concatenate([taken, positions_m[free]])
        _hang_cables(yard, positions_m[free])


def _hang_cables(yard: Yard, positions_m: Float64Array) -> None:
    """Hang cables from each pole to the next one, if it is near enough."""
    feet_m = np.column_stack([positions_m, surface_m(yard.ground, positions_m, 0)])
    for foot_m, next_m in pairwise(feet_m):
        step_m = next_m[:2] - foot_m[:2]
        length_m = float(np.hypot(*step_m))
        if length_m < 1.5 * _POLE_SPACING_M:
            mesh = cables(foot_m, next_m, left_of(step_m / length_m))
            yard.tiles.place(mesh, upright_pose(foot_m[:2], float(foot_m[2])))
