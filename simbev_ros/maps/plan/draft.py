"""A draft of roads: lines in plan with a cross-section, before they are divided where they meet.

Patterns (grid, roads, roundabout, interchange, region, ...) append to a draft; ``noding`` divides it at its junctions,
``profile`` gives it heights, ``sumo_xml`` writes it down.
"""

from dataclasses import dataclass, field

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.types import Float64Array


class RoadClass(Model):
    """A cross-section, the same for both directions of a two-way road."""

    lanes: int = Field(1, ge=1, le=6, description="driving lanes per direction")
    one_way: bool = False
    lane_width_m: float = Field(3.5, ge=2.5, le=5)
    speed_kmh: float = Field(50.0, gt=0, le=140)
    sidewalk_m: float = Field(0.0, ge=0, le=8, description="0: none")
    bicycle_m: float = Field(0.0, ge=0, le=3, description="bicycle lane; 0: none")
    parking_m: float = Field(0.0, ge=0, le=3, description="parking lane; 0: none")
    shoulder_m: float = Field(0.0, ge=0, le=5, description="0: none")
    median_m: float = Field(0.0, ge=0, le=20, description="between the directions; 0: a painted line")
    priority: int = Field(1, ge=1, le=12, description="at junctions the higher one has right of way")


@dataclass(frozen=True, slots=True)
class DraftRoad:
    """One road.

    Roads of one layer meet where they cross in plan, and where one ends on another. Roads of different layers pass over
    and under each other, the higher layer above, and meet only where they share a vertex of both lines (within 0.5 m).

    Attributes:
        name: Unique in its draft.
        kind: Cross-section. The line is the middle of it, the median included; one-way roads run along the line.
        line_m: (N, 2) float64 plan, map frame; curves as vertices about 5 m apart.
        layer: 0 on the ground; others above (positive) or below it.
        elevated_m: Kept at least so high above the land on a structure, as city motorways on pillars are; 0: no.
    """

    name: str
    kind: RoadClass
    line_m: Float64Array
    layer: int = 0
    elevated_m: float = 0.0


@dataclass
class Draft:
    """Roads, and where traffic lights are wanted whatever the rule says: junctions within 10 m of (2,) places."""

    roads: list[DraftRoad] = field(default_factory=list)
    signals_m: list[Float64Array] = field(default_factory=list)
