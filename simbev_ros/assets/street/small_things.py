"""Puts small things of streets, from small_things.yaml: bollards, meters, boxes, bins, planters; single or in rows."""

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import shapely

from simbev_ros.assets.land.blocks import Block
from simbev_ros.assets.land.yard import Yard, yaw_of
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box, lathe
from simbev_ros.assets.palette import rgb
from simbev_ros.assets.placement.ensemble import Base
from simbev_ros.assets.street.curbs import STATION_M, CurbLine
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.tables import load_table
from simbev_ros.maps.surroundings import SurroundingsRecipe

_BEHIND_WALK_M = 0.75
_TURNED_SIDES = 8


@lru_cache(maxsize=64)
def small_thing(name: str) -> Mesh:
    """Mesh of a thing of the table."""
    pieces = []
    for material, tag, color, *shape in _table()["things"][name]["parts"]:
        finish = Finish(Material[material], Tag[tag], rgb(int(color)))
        if shape[0] == "turned":
            pieces.append(lathe(finish, np.array(shape[1:]).reshape(-1, 2), segments=_TURNED_SIDES))
        else:
            x, y, z, *center = shape
            pieces.append(box(finish, (x, y, z), (center[0], center[1], center[2])))
    return Mesh.merge(pieces)


def put_along_curbs(yard: Yard, curbs: Sequence[CurbLine]) -> None:
    """Put things on the line beside the curb, where sidewalks and verges still have room."""
    for number, curb in enumerate(curbs):
        if curb.level:
            continue
        rng, count = yard.ground.stream(f"curb_things.{number}"), len(curb.position_m)
        base = Base.SIDEWALK if curb.walk else Base.LAND
        for name, at in _groups("curb", curb.recipe, count * STATION_M, rng):
            at = (at / STATION_M).astype(int)
            at = at[at < count]
            free = yard.claims.claim_discs(curb.position_m[at], np.full(len(at), _table()["things"][name]["room_m"]))
            chosen = at[free]
            yard.ensemble.put(small_thing(name), curb.position_m[chosen], curb.yaw_rad[chosen], base=base)


def put_behind_walks(yard: Yard, blocks: Sequence[Block]) -> None:
    """Put things on the land just behind the sidewalk, with their backs to it."""
    for block in blocks:
        rng = yard.ground.stream(f"back_things.{block.name}")
        for line in block.frontage:
            if line.beyond or not line.walk:
                continue
            for name, at in _groups("back", block.recipe, line.length_m - 1.0, rng):
                room_m = float(_table()["things"][name]["room_m"])
                for s_m in at.tolist():
                    position_m, along = line.chord(s_m, 1.0)
                    position_m = position_m + left_of(along) * (_BEHIND_WALK_M + room_m)
                    if yard.claim(shapely.Point(position_m).buffer(room_m, quad_segs=2), block.land):
                        yard.ensemble.put(small_thing(name), position_m, yaw_of(-left_of(along)))


def _groups(
    side: str, recipe: SurroundingsRecipe, length_m: float, rng: np.random.Generator
) -> Iterator[tuple[str, np.ndarray[tuple[int], np.dtype[np.float64]]]]:
    """Names of things, and the (N,) distances at which they stand along a line."""
    spacing_m = _table()["spacing_m"][side].get(recipe.use)
    weights = _weights(side, recipe.use)
    if spacing_m is None or not weights:
        return
    s_m = float(rng.uniform(0.2, 1.0)) * spacing_m
    while s_m < length_m:
        name = list(weights)[int(rng.choice(len(weights), p=list(weights.values())))]
        step_m = _table()["things"][name].get("row")
        count = 1 if step_m is None else 1 + int(rng.integers(1, max(2, int(_table()["row_m"] / step_m))))
        at_m = s_m + np.arange(count) * (step_m or 0.0)
        if rng.random() < 2.0 * recipe.furniture_density:
            yield name, at_m[at_m < length_m]
        s_m = float(at_m[-1]) + spacing_m * float(rng.uniform(0.5, 1.5))


@lru_cache(maxsize=32)
def _weights(side: str, use: str) -> dict[str, float]:
    """Shares of the things on one side of a use's sidewalks."""
    weights = {name: float(entry.get(side, {}).get(use, 0.0)) for name, entry in _table()["things"].items()}
    return {name: weight / sum(weights.values()) for name, weight in weights.items() if weight}


@lru_cache(maxsize=1)
def _table() -> Mapping[str, Any]:
    return load_table("simbev_ros.assets.street", "small_things.yaml")
