"""What stands along the curbs: signal poles, street lights, trees, signs, benches, bins, hydrants."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from simbev_ros.assets.claims import Claims
from simbev_ros.assets.furniture import (
    LAMP_AT_M,
    bench,
    bus_shelter,
    hydrant,
    litter_bin,
    street_light,
    with_lamp_index,
)
from simbev_ros.assets.ground import CURB_HEIGHT_M, LAND_HEIGHT_M
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.palette import pick_color
from simbev_ros.assets.plants import Grove
from simbev_ros.assets.primitives import Finish, box
from simbev_ros.assets.signal_poles import signal_poles
from simbev_ros.assets.signs import speed_sign, street_name_sign
from simbev_ros.assets.static_scene import StreetLight
from simbev_ros.assets.tiles import TileBuilder, standing
from simbev_ros.assets.town_plan import BlockUse, TownPlan, front_sides
from simbev_ros.geometry.transforms import apply
from simbev_ros.maps.lane_kind import LaneKind
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.surroundings import SurroundingsRecipe
from simbev_ros.random import stream
from simbev_ros.semantics import Tag
from simbev_ros.types import Float64Array

_FROM_CURB_M = 0.55
_KEEP_FROM_CROSSING_M = 2.0
_KEEP_FROM_CORNER_M = 1.0
_STAGGER = 0.9
_TREE_LINED_SHARE = 0.6
_SIGNED_SHARE = 0.25
_SHELTERED_SHARE = 0.2


@dataclass(frozen=True, slots=True)
class CurbLine:
    """A stretch of curb that furniture may stand along: (N, 2) places half a metre apart, (N,) yaw towards the road."""

    place_m: Float64Array
    yaw_rad: Float64Array


@dataclass(frozen=True, slots=True)
class Street:
    """What all that stands along the curbs is placed with."""

    tiles: TileBuilder
    claims: Claims
    network: RoadNetwork
    recipe: SurroundingsRecipe
    curbs: tuple[CurbLine, ...]
    seed: int


def furnish_streets(
    tiles: TileBuilder, claims: Claims, network: RoadNetwork, plan: TownPlan, recipe: SurroundingsRecipe, seed: int
) -> tuple[StreetLight, ...]:
    """Add all that stands along the curbs; what comes first has the choice of place."""
    street = Street(tiles, claims, network, recipe, tuple(_curb_lines(plan)), seed)
    _put_signals(street)
    lights = tuple(_put_lights(street))
    _put_bus_shelters(street, plan)
    _put_speed_signs(street)
    _put_name_signs(street)
    _put_trees(street)
    _put_small_things(street)
    return lights


def _curb_lines(plan: TownPlan) -> Iterator[CurbLine]:
    """Lines on the sidewalks beside the road, away from crosswalks."""
    line = plan.road.buffer(_FROM_CURB_M).boundary.intersection(plan.sidewalk.buffer(-0.3))
    line = line.difference(shapely.union_all(list(plan.crossings)).buffer(_KEEP_FROM_CROSSING_M))
    parts = shapely.get_parts(shapely.line_merge(line))
    shapely.prepare(plan.road)
    for part in sorted((part for part in parts if part.length > 6.0), key=lambda part: part.coords[0]):
        stations = np.arange(_KEEP_FROM_CORNER_M, part.length - _KEEP_FROM_CORNER_M, 0.5)
        points = shapely.line_interpolate_point(part, stations)
        nearest = shapely.get_coordinates(shapely.shortest_line(points, plan.road)).reshape(-1, 2, 2)
        towards = nearest[:, 1] - nearest[:, 0]
        yield CurbLine(nearest[:, 0], np.arctan2(towards[:, 1], towards[:, 0]))


def _disc(place_m: Float64Array, radius_m: float) -> shapely.Polygon:
    return shapely.Point(place_m[0], place_m[1]).buffer(radius_m, quad_segs=4)


def _put_signals(street: Street) -> None:
    for mesh, map_from_pole in signal_poles(street.network):
        street.claims.add(_disc(map_from_pole[:2, 3], 0.8))
        street.tiles.place(mesh, map_from_pole)


def _put_lights(street: Street) -> Iterator[StreetLight]:
    """Street lights, staggered on the two sides: each keeps a distance from those across the street too."""
    spacing_m = street.recipe.street_light_spacing_m
    template, occupied = street_light(), np.empty((0, 2))
    for curb in street.curbs:
        for place_m, yaw_rad in zip(curb.place_m[::2], curb.yaw_rad[::2], strict=True):
            near = np.linalg.norm(occupied - place_m, axis=1) < _STAGGER * spacing_m
            if near.any() or not street.claims.claim(_disc(place_m, 0.3)):
                continue
            pose = standing(place_m, CURB_HEIGHT_M, yaw_rad)
            street.tiles.place(with_lamp_index(template, (Material.STREET_LAMP,), len(occupied)), pose)
            occupied = np.concatenate([occupied, place_m[None]])
            x_m, y_m, z_m = apply(pose, np.array([LAMP_AT_M]))[0]
            yield StreetLight((float(x_m), float(y_m), float(z_m)))


def _put_bus_shelters(street: Street, plan: TownPlan) -> None:
    """Shelters just behind the sidewalk, open to the street."""
    rng = stream(street.seed, "surroundings.bus_shelters")
    for block in plan.blocks:
        for side in front_sides(block, shortest_m=60.0):
            place_m = side.start_m + side.direction * side.length_m * rng.uniform(0.25, 0.75) + side.inward * 1.1
            pose = standing(place_m, LAND_HEIGHT_M, side.yaw_rad - np.pi / 2.0)
            wanted = block.use is not BlockUse.OUTSKIRTS and rng.random() < _SHELTERED_SHARE
            if wanted and street.claims.claim(_disc(place_m, 2.4)):
                street.tiles.place(bus_shelter(), pose)


def _put_speed_signs(street: Street) -> None:
    """Some streets begin with a sign of their speed limit, to the right of the traffic that it is for."""
    rng = stream(street.seed, "surroundings.speed_signs")
    places = np.concatenate([curb.place_m for curb in street.curbs])
    for lane in street.network.lanes.values():
        if lane.kind is not LaneKind.DRIVING or lane.junction or lane.length_m < 40.0 or rng.random() > _SIGNED_SHARE:
            continue
        position, yaw_rad = street.network.pose_on_lane(lane.id, 18.0)
        right = np.array([np.sin(yaw_rad), -np.cos(yaw_rad)])
        wanted = position[:2] + right * (lane.width_m / 2.0 + _FROM_CURB_M)
        distances = np.linalg.norm(places - wanted, axis=1)
        place_m = places[np.argmin(distances)]
        if distances.min() < 1.0 and street.claims.claim(_disc(place_m, 0.4)):
            street.tiles.place(
                speed_sign(round(lane.speed_mps * 3.6)), standing(place_m, CURB_HEIGHT_M, yaw_rad + np.pi)
            )


def _put_name_signs(street: Street) -> None:
    """Name plates at one corner of each junction."""
    places = np.concatenate([curb.place_m for curb in street.curbs])
    yaws = np.concatenate([curb.yaw_rad for curb in street.curbs])
    template = street_name_sign((28, 92, 64))
    for junction in street.network.junctions.values():
        order = np.argsort(np.linalg.norm(places - junction.center_m[:2], axis=1), kind="stable")[:40]
        for k in order:
            if street.claims.claim(_disc(places[k], 0.3)):
                street.tiles.place(template, standing(places[k], CURB_HEIGHT_M, float(yaws[k])))
                break


def _put_trees(street: Street) -> None:
    """Avenues: trees in pits, one kind to a stretch of curb."""
    rng = stream(street.seed, "surroundings.street_trees")
    grove = Grove(rng)
    pit = box(Finish(Material.SOIL, Tag.TERRAIN, (92, 76, 58)), (0.7, 1.4, 0.06), (0.0, 0.0, -0.018))
    step = max(1, round(street.recipe.tree_spacing_m / 0.5))
    share = _TREE_LINED_SHARE * min(1.0, 2.0 * street.recipe.plant_density)
    for curb in street.curbs:
        kind, lined = ("round", "tall")[int(rng.random() < 0.35)], rng.random() < share
        for place_m, yaw_rad in zip(curb.place_m[6::step], curb.yaw_rad[6::step], strict=True):
            if lined and rng.random() < 0.9 and street.claims.claim(_disc(place_m, 1.6)):
                street.tiles.place(pit, standing(place_m, CURB_HEIGHT_M, yaw_rad))
                street.tiles.place(*grove.plant(kind, np.array([*place_m, CURB_HEIGHT_M])))


def _put_small_things(street: Street) -> None:
    """Bins, hydrants and benches in the room that is left."""
    rng = stream(street.seed, "surroundings.small_things")
    things: tuple[tuple[Mesh, float, float], ...] = (
        (litter_bin(pick_color(rng, "bins")), 0.35, 0.4),
        (hydrant(), 0.3, 0.2),
        (bench(), 1.0, 0.4),
    )
    for curb in street.curbs:
        for start, stop in pairwise(range(0, len(curb.place_m), 40)):
            mesh, radius_m, share = things[int(rng.integers(len(things)))]
            k = int(rng.integers(start, stop))
            if rng.random() < share and street.claims.claim(_disc(curb.place_m[k], radius_m)):
                street.tiles.place(mesh, standing(curb.place_m[k], CURB_HEIGHT_M, float(curb.yaw_rad[k])))
