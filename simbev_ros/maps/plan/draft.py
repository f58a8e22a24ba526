"""A draft of a town's roads: lines in plan view with cross-sections, before they are divided at their intersections.

Patterns (grid, roads, roundabout, interchange, region, ...) append to a draft; ``noding`` divides it at its junctions,
``profile`` computes heights, ``sumo_xml`` writes the result.
"""

from dataclasses import dataclass, field
from typing import Literal

import shapely
from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land_features import Zone


class RoadClass(Model):
    """A cross-section; for two-way roads, each value applies to each direction."""

    lanes: int = Field(1, ge=0, le=6, description="driving lanes per direction; 0: a footpath")
    one_way: bool = False
    lane_width_m: float = Field(3.5, ge=2.5, le=5)
    speed_kmh: float = Field(50.0, gt=0, le=140)
    sidewalk_m: float = Field(0.0, ge=0, le=8, description="0: none")
    verge: bool = Field(False, description="the sidewalk is a grass verge that people walk on: unpaved, no crossings")
    bicycle_m: float = Field(0.0, ge=0, le=3, description="bicycle lane; 0: none")
    parking_m: float = Field(0.0, ge=0, le=3, description="parking lane; 0: none")
    shoulder_m: float = Field(0.0, ge=0, le=5, description="right of the lanes; 0: none")
    left_shoulder_m: float = Field(0.0, ge=0, le=5, description="one-way roads: left of the lanes; 0: none")
    median_m: float = Field(0.0, ge=0, le=20, description="between the directions; 0: a painted line")
    line_at: Literal["middle", "left"] = Field(
        "middle", description="left: a one-way road's line is the left edge of its driving lanes"
    )
    priority: int = Field(1, ge=1, le=12, description="at junctions, the higher priority has right of way")
    corner_radius_m: float = Field(6.0, ge=1, le=20, description="radius of the curb at junctions")


@dataclass(frozen=True, slots=True)
class DraftRoad:
    """A road of a draft.

    Roads of one layer meet where they cross in plan view, and where one ends on another. Roads of different layers pass
    over and under each other, the higher layer above, and meet only where one ends at a vertex of the other (within 0.5
    m).

    Attributes:
        name: Unique in its draft.
        kind: Cross-section. The line is its middle, including the median, unless its ``line_at`` says otherwise;
            one-way roads run along the line.
        line_m: (N, 2) float64 plan view, map frame; curves have vertices about 5 m apart.
        layer: 0 on the ground; others above (positive) or below it.
        elevated_m: Minimum height above the land, on a structure, as for city motorways on pillars; 0: on the land.
        joins_m: Points at which its start and its end meet other roads, if not at the line's own ends: (2,) vertices of
            other roads' lines, of any layer. This allows a ramp to end beside the lanes that it joins, while they all
            meet at one point.
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
        signals_m: (2,) points; junctions within 10 m of them get traffic lights regardless of the rule.
        zones: Areas with their own surroundings; where they overlap, the last one takes precedence.
        water: Areas of rivers and lakes; their surface height follows from the land.
    """

    roads: list[DraftRoad] = field(default_factory=list)
    signals_m: list[Float64Array] = field(default_factory=list)
    zones: list[Zone] = field(default_factory=list)
    water: list[shapely.Polygon] = field(default_factory=list)
