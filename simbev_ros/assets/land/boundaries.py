"""Closes the gaps between buildings along streets: walls, railings, fences and rows of bollards behind the sidewalk."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from simbev_ros.assets.land.blocks import Block
from simbev_ros.assets.land.fencing import put_panels
from simbev_ros.assets.land.yard import Yard
from simbev_ros.assets.placement.ensemble import Base
from simbev_ros.assets.street.barriers import PANEL_M, VARIANTS, panel
from simbev_ros.assets.street.curbs import CurbLine
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.tables import load_table
from simbev_ros.maps.land_features import BARRIER_KINDS
from simbev_ros.maps.roads.lane_kind import LaneKind

_STRETCH_M = (9.0, 30.0)
_BEHIND_WALK_M, _PANELS_IN_BENDS, _BEND_M = 0.3, 3, 0.45  # in bends, frontages are only approximate
_GUARDED_M, _GUARDED_SHARE = 26.0, 0.95
_GUARD_AT_CURB_M = -0.1  # nearer to the curb than the line of posts
_GUARD_ROOM_M = 0.12
_RAILED_SHARE, _CLEAR_OF_END_M, _PANELS_ON_MEDIANS, _ON_MEDIANS = 0.9, 5.0, 4, ("guard", "railing", "guard")


def put_boundaries(yard: Yard, blocks: Sequence[Block]) -> None:
    """Put barriers along the streets of built-up land, stretch by stretch, where the ground is free."""
    walls = shapely.STRtree(yard.walls)
    for block in blocks:
        entry = _table().get(block.recipe.use)
        if entry is None or block.is_island:
            continue
        rng = yard.ground.stream(f"boundaries.{block.name}")
        share = entry["share"] * min(1.0, 3.0 * block.recipe.fence_density)
        weights = np.array([weight for weight, _ in entry["choices"]])
        for line in block.frontage:
            s_m, is_straight = 0.0, len(line.line.coords) == 2
            while s_m < line.length_m - _STRETCH_M[0]:
                length_m = min(float(rng.uniform(*_STRETCH_M)), line.length_m - s_m)
                kind = entry["choices"][int(rng.choice(len(weights), p=weights / weights.sum()))][1]
                wanted, mesh = rng.random() < share, panel(kind, int(rng.integers(VARIANTS)))
                step_m = length_m if is_straight else _PANELS_IN_BENDS * PANEL_M[kind]
                for at_m in np.arange(s_m, s_m + length_m - step_m + 0.01, step_m) if wanted else ():
                    start_m, along = line.chord(float(at_m), step_m)
                    start_m = start_m + (_BEHIND_WALK_M + (not is_straight) * _BEND_M) * left_of(along)
                    if not line.beyond and not yard.map_objects.replace(BARRIER_KINDS, start_m[None])[0]:
                        clear = (walls, float(entry["from_wall_m"]))
                        put_panels(yard, mesh, kind, start_m, start_m + 1.001 * step_m * along, block.land, clear)
                s_m += length_m


def put_guards(yard: Yard, curbs: Sequence[CurbLine]) -> None:
    """Put guard rails along the curbs beside crosswalks, where nobody may park or cross."""
    crosswalks = yard.ground.streets[0].crosswalk
    shapely.prepare(crosswalks)
    for number, curb in enumerate(curbs):
        rng = yard.ground.stream(f"guards.{number}")
        wanted = rng.random() < _GUARDED_SHARE and curb.recipe.use in ("downtown", "residential", "campus")
        if not wanted or not curb.walk or curb.level or len(curb.position_m) == 0:
            continue
        mesh, step = panel("guard", int(rng.integers(VARIANTS))), round(PANEL_M["guard"] / 0.5)
        toward = np.column_stack([np.cos(curb.yaw_rad), np.sin(curb.yaw_rad)])
        at_m = curb.position_m - _GUARD_AT_CURB_M * toward
        starts, ends = at_m[:-step:step], at_m[step::step]
        near = shapely.dwithin(crosswalks, shapely.points((starts + ends) / 2.0), _GUARDED_M)
        for start_m, end_m in zip(starts[near], ends[near], strict=True):
            room = shapely.LineString([start_m, end_m]).buffer(_GUARD_ROOM_M, quad_segs=1, cap_style="flat")
            if yard.claim(room, yard.inside):
                along = end_m - start_m
                yard.ensemble.put(mesh, start_m, float(np.arctan2(along[1], along[0])), base=Base.SIDEWALK)


def put_median_railings(yard: Yard) -> None:
    """Put a railing along the middle of some medians, clear of their ends and of crosswalks."""
    ground = yard.ground
    free = overlay.difference(ground.streets[0].median, shapely.buffer(ground.streets[0].crosswalk, _CLEAR_OF_END_M))
    for strip in ground.network.layout.near(ground.region.area, 0.0).strips_of(LaneKind.MEDIAN, level=0):
        rng = stream(ground.network.seed, f"median_railings.{strip.lane}")
        line = shapely.LineString(strip.left_m[:, :2])
        kind, variant = _ON_MEDIANS[int(rng.integers(len(_ON_MEDIANS)))], int(rng.integers(VARIANTS))
        if rng.random() > _RAILED_SHARE or line.length < 2.0 * _CLEAR_OF_END_M:
            continue
        at_m = np.arange(_CLEAR_OF_END_M, line.length - _CLEAR_OF_END_M, _PANELS_ON_MEDIANS * PANEL_M[kind])
        ends_m = shapely.get_coordinates(shapely.line_interpolate_point(line, at_m))
        for start_m, end_m in pairwise(ends_m):
            put_panels(
                yard, panel(kind, variant), kind, start_m, end_m + 0.01 * (end_m - start_m), free, base=Base.SIDEWALK
            )


@lru_cache(maxsize=1)
def _table() -> Mapping[str, Any]:
    return load_table("simbev_ros.assets.land", "boundaries.yaml")["boundaries"]
