"""The roundabout pattern: a one-way ring; roads drawn before it end on the ring and become its arms."""

from dataclasses import replace
from typing import Literal

import numpy as np
import shapely
from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.maps.plan.draft import Draft, DraftRoad
from simbev_ros.maps.plan.lines import arc
from simbev_ros.maps.plan.patterns.road import Place
from simbev_ros.maps.plan.road_class import NamedRoadClass, road_classes

_SHORTEST_ARM_M = 20.0


class Roundabout(Model):
    """One roundabout on the ground."""

    pattern: Literal["roundabout"]
    name: str
    center_m: Place
    radius_m: float = Field(22.0, ge=10, le=100, description="to the middle of its lanes")
    road: NamedRoadClass = Field(default_factory=lambda: road_classes()["circle"])


def draw(pattern: Roundabout, draft: Draft, rng: np.random.Generator) -> None:
    """Cut the draft's roads at the ring and append the ring; nothing of it is random."""
    center_m = np.array(pattern.center_m)
    ring_m = arc(center_m, pattern.radius_m, -np.pi / 2.0, 2.0 * np.pi)
    ring_m[-1] = ring_m[0]
    island = shapely.Polygon(ring_m)
    draft.roads[:] = [piece for road in draft.roads for piece in _outside(road, island)]
    draft.roads.append(DraftRoad(pattern.name, pattern.road, ring_m))


def _outside(road: DraftRoad, island: shapely.Polygon) -> list[DraftRoad]:
    """What is left of a road; stubs are dropped."""
    line = shapely.LineString(road.line_m)
    if road.layer != 0 or not line.intersects(island):
        return [road]
    pieces = [piece for piece in shapely.get_parts(line.difference(island)) if piece.length >= _SHORTEST_ARM_M]
    return [
        replace(road, name=road.name if len(pieces) == 1 else f"{road.name}/{index}", line_m=np.array(piece.coords))
        for index, piece in enumerate(pieces)
    ]
