"""Closes the gaps between buildings along streets: walls, railings, fences and rows of bollards behind the sidewalk."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import shapely

from simbev_ros.assets.land.blocks import Block
from simbev_ros.assets.land.fencing import put_panels
from simbev_ros.assets.land.yard import Yard
from simbev_ros.assets.placement.ensemble import Base
from simbev_ros.assets.street.barriers import PANEL_M, VARIANTS, panel
from simbev_ros.assets.street.curbs import CurbLine
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.tables import load_table
from simbev_ros.maps.land_features import BARRIER_KINDS

_STRETCH_M = (9.0, 30.0)
_BEHIND_WALK_M = 0.3
_GUARDED_M, _GUARDED_SHARE = 12.0, 0.6
_GUARD_AT_CURB_M = -0.1  # nearer to the curb than the line of posts
_GUARD_ROOM_M = 0.12


def put_boundaries(yard: Yard, blocks: Sequence[Block]) -> None:
    """Put barriers along the streets of built-up land, stretch by stretch, where the ground is free."""
    walls = shapely.STRtree(yard.walls)
    for block in blocks:
        entry = _table().get(block.recipe.use)
        if entry is None or block.is_island:
            continue
        rng = yard.ground.stream(f"boundaries.{block.name}")
        share = entry["share"] * min(1.0, 0.5 + block.recipe.fence_density)
        weights = np.array([weight for weight, _ in entry["choices"]])
        for line in block.frontage:
            s_m = 0.0
            while s_m < line.length_m - _STRETCH_M[0]:
                length_m = min(float(rng.uniform(*_STRETCH_M)), line.length_m - s_m)
                kind = entry["choices"][int(rng.choice(len(weights), p=weights / weights.sum()))][1]
                wanted, variant = rng.random() < share, int(rng.integers(VARIANTS))
                start_m, along = line.chord(s_m, length_m)
                start_m = start_m + _BEHIND_WALK_M * left_of(along)
                if wanted and not line.beyond and not yard.map_objects.replace(BARRIER_KINDS, start_m[None])[0]:
                    clear = (walls, float(entry["from_wall_m"]))
                    put_panels(yard, panel(kind, variant), kind, start_m, start_m + length_m * along, block.land, clear)
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


@lru_cache(maxsize=1)
def _table() -> Mapping[str, Any]:
    return load_table("simbev_ros.assets.land", "boundaries.yaml")["boundaries"]
