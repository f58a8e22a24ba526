"""Puts the many small signs of streets: on posts and lamp posts, boards behind the sidewalk, islands of crossings."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import shapely

from simbev_ros.assets.land.blocks import Block
from simbev_ros.assets.land.yard import Yard, yaw_of
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.graded import GradedMesh
from simbev_ros.assets.mesh.primitives import Finish, box, lathe
from simbev_ros.assets.placement.ensemble import Base
from simbev_ros.assets.street.curbs import STATION_M, CurbLine
from simbev_ros.assets.street.light_places import Lanes
from simbev_ros.assets.street.sign_faces import VARIANTS, board, draw_choice, plate, shift_graded, sign_post, sign_table
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind

_AMERICA_DEG = (-170.0, -30.0)
_POST_ROOM_M = 0.3
_JITTER_RAD = 0.12
_BEHIND_WALK_M = 0.75
_PLATE_ON_LAMP_M, _LAMP_RADIUS_M = 2.75, 0.1
_ISLAND_END_M, _MIN_ISLAND_M = 0.9, 5.0


def is_american(network: RoadNetwork) -> bool:
    """Whether a map lies in the Americas, where signs of warning are yellow diamonds."""
    return _AMERICA_DEG[0] < network.datum.longitude_deg < _AMERICA_DEG[1]


def put_sign_posts(yard: Yard, curbs: Sequence[CurbLine], lanes: Lanes) -> None:
    """Put signs on posts along sidewalks and verges; they look at the traffic of the nearest lane."""
    american = is_american(yard.ground.network)
    for number, curb in enumerate(curbs):
        entry = sign_table()["posts"][curb.recipe.use]
        rng = yard.ground.stream(f"sign_posts.{number}")
        every = entry["spacing_m"] / STATION_M
        at = np.cumsum(every * rng.uniform(0.35, 1.65, int(len(curb.position_m) / every) + 1)) - every / 2.0
        at = at[(at >= 0.0) & (at < len(curb.position_m) - 1)].astype(int)
        if curb.level or len(at) == 0 or len(lanes.lines) == 0:
            continue
        yaw_rad = lanes.against_rad(curb.position_m[at]) + rng.normal(0.0, _JITTER_RAD, len(at))
        free = yard.claims.claim_discs(curb.position_m[at], np.full(len(at), _POST_ROOM_M))
        base = Base.SIDEWALK if curb.walk else Base.LAND
        for k in np.flatnonzero(free).tolist():
            mesh = sign_post(draw_choice(entry, american, rng), int(rng.integers(VARIANTS)))
            yard.ensemble.put(mesh, curb.position_m[at[k]], float(yaw_rad[k]), base=base)


def put_boards(yard: Yard, blocks: Sequence[Block], lanes: Lanes) -> None:
    """Put boards on the land behind sidewalks: directions, advertisements, of agents who sell a house."""
    american = is_american(yard.ground.network)
    for block in blocks:
        entry = sign_table()["boards"][block.recipe.use]
        rng = yard.ground.stream(f"boards.{block.name}")
        for line in block.frontage:
            if line.beyond or len(lanes.lines) == 0:
                continue
            positions, along = line.stations(entry["spacing_m"], rng.uniform(2.0, entry["spacing_m"]))
            for position_m, direction in zip(positions, along, strict=True):
                inward = left_of(direction / np.hypot(*direction))
                (name,) = draw_choice(entry, american, rng)
                half_m = sign_table()["faces"][name]["size_m"][0] / 2.0
                foot_m = position_m + inward * (_BEHIND_WALK_M + half_m)
                yaw_rad = float(lanes.against_rad(foot_m[None])[0]) + rng.normal(0.0, _JITTER_RAD)
                across = np.array([-np.sin(yaw_rad), np.cos(yaw_rad)]) * half_m
                room = shapely.LineString([foot_m - across, foot_m + across]).buffer(0.2, quad_segs=1)
                if yard.claim(room, block.land):
                    yard.ensemble.put(board(name, int(rng.integers(VARIANTS))), foot_m, yaw_rad)


def put_lamp_plates(yard: Yard, lanes: Lanes) -> None:
    """Put plates and banners on some of the street lights."""
    rng, entry = yard.ground.stream("lamp_plates"), sign_table()["lamps"]
    american = is_american(yard.ground.network)
    if not yard.lamp_posts or len(lanes.lines) == 0:
        return
    yaws_rad = lanes.against_rad(np.stack([position_m for position_m, _ in yard.lamp_posts]))
    for (position_m, base), yaw_rad in zip(yard.lamp_posts, yaws_rad.tolist(), strict=True):
        wanted = rng.random() < entry["share"]
        (name,), variant = draw_choice(entry, american, rng), int(rng.integers(VARIANTS))
        if wanted:
            yard.ensemble.put(_on_lamp(name, variant), position_m, yaw_rad, base=base)


def put_islands(yard: Yard) -> None:
    """Put a lit bollard with the sign "keep right" at the ends of medians, where traffic meets them."""
    ground = yard.ground
    median = ground.streets[0].median
    shapely.prepare(median)
    for strip in ground.network.layout.near(ground.region.area, 0.0).strips_of(LaneKind.MEDIAN, level=0):
        line = shapely.LineString(strip.center_m[:, :2])
        if line.length < _MIN_ISLAND_M:
            continue
        for at_m, back_m in ((_ISLAND_END_M, _ISLAND_END_M + 1.0), (line.length - _ISLAND_END_M, line.length - 1.9)):
            end_m, inner_m = (shapely.get_coordinates(line.interpolate(s_m))[0] for s_m in (at_m, back_m))
            room = shapely.Point(end_m).buffer(0.4, quad_segs=2)
            if median.contains(room) and yard.claim(room, yard.inside):
                yard.ensemble.put(_island_bollard(), end_m, yaw_of(end_m - inner_m), base=Base.SIDEWALK)


@lru_cache(maxsize=256)
def _on_lamp(name: str, variant: int) -> GradedMesh:
    """A plate on a lamp post, in the post's frame; banners hang beside it."""
    width_m, height_m = sign_table()["faces"][name]["size_m"]
    aside_m = width_m / 2.0 + 0.15 if height_m > 1.0 else 0.0
    return shift_graded(plate(name, variant), _LAMP_RADIUS_M, aside_m, _PLATE_ON_LAMP_M + aside_m)


@lru_cache(maxsize=1)
def _island_bollard() -> GradedMesh:
    """A bollard with a sign on it, 1.7 m high."""
    body = box(Finish(Material.PLASTIC, Tag.POLE, (226, 198, 60)), (0.24, 0.42, 1.2), (0.0, 0.0, 0.45), bevel_m=0.03)
    foot = lathe(
        Finish(Material.CONCRETE, Tag.POLE, (150, 147, 140)), np.array([[0.3, -0.25], [0.3, 0.05]]), segments=8
    )
    sign = shift_graded(plate("keep_right"), 0.125, 0.0, 1.3)
    return GradedMesh.merge([GradedMesh(body, body), GradedMesh(foot, foot), sign])
