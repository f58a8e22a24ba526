"""A draft of roads: lines in plan with a cross-section, before they are divided where they meet.

Patterns (grid, roads, roundabout, interchange, region, ...) append to a draft; ``noding`` divides it at its junctions,
``profile`` gives it heights, ``sumo_xml`` writes it down.
"""

from dataclasses import dataclass, field
from typing import Literal

import shapely
from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.maps.land_features import Zone
from simbev_ros.types import Float64Array


class RoadClass(Model):
    """A cross-section, the same for both directions of a two-way road."""

    lanes: int = Field(1, ge=0, le=6, description="driving lanes per direction; 0: a footpath")
    one_way: bool = False
    lane_width_m: float = Field(3.5, ge=2.5, le=5)
    speed_kmh: float = Field(50.0, gt=0, le=140)
    sidewalk_m: float = Field(0.0, ge=0, le=8, description="0: none")
    bicycle_m: float = Field(0.0, ge=0, le=3, description="bicycle lane; 0: none")
    parking_m: float = Field(0.0, ge=0, le=3, description="parking lane; 0: none")
    shoulder_m: float = Field(0.0, ge=0, le=5, description="right of the lanes; 0: none")
    left_shoulder_m: float = Field(0.0, ge=0, le=5, description="one-way roads: left of the lanes; 0: none")
    median_m: float = Field(0.0, ge=0, le=20, description="between the directions; 0: a painted line")
    line_at: Literal["middle", "left"] = Field(
        "middle", description="left: a one-way road's line is the left edge of its driving lanes"
    )
    priority: int = Field(1, ge=1, le=12, description="at junctions the higher one has right of way")
    corner_radius_m: float = Field(6.0, ge=1, le=20, description="of the curb at junctions")


@dataclass(frozen=True, slots=True)
class DraftRoad:
    """One road.

    Roads of one layer meet where they cross in plan, and where one ends on another. Roads of different layers pass over
    and under each other, the higher layer above, and meet only where one ends at a vertex of the other (within 0.5 m).

    Attributes:
        name: Unique in its draft.
        kind: Cross-section. The line is the middle of it, the median included, unless its ``line_at`` says otherwise;
            one-way roads run along the line.
        line_m: (N, 2) float64 plan, map frame; curves as vertices about 5 m apart.
        layer: 0 on the ground; others above (positive) or below it.
        elevated_m: Kept at least so high above the land on a structure, as city motorways on pillars are; 0: no.
        joins_m: Where its start and its end meet other roads if not at the line's own ends: (2,) vertices of other
            roads' lines, of any layer. So a ramp's end lies beside the lanes that it joins, which meet it in one place.
    """

    name: str
    kind: RoadClass
    line_m: Float64Array
    layer: int = 0
    elevated_m: float = 0.0
    joins_m: tuple[Float64Array | None, Float64Array | None] = (None, None)


@dataclass
class Draft:
    """A town before its roads are divided.

    Attributes:
        roads: In any order.
        signals_m: Where traffic lights are wanted whatever the rule says: junctions within 10 m of (2,) places.
        zones: Land with a character of its own; where they overlap, the last one holds.
        water: Areas of rivers and lakes; their surface follows from the land.
    """

    roads: list[DraftRoad] = field(default_factory=list)
    signals_m: list[Float64Array] = field(default_factory=list)
    zones: list[Zone] = field(default_factory=list)
    water: list[shapely.Polygon] = field(default_factory=list)
