"""The key of a lane of a map file."""

from typing import NamedTuple


class LaneKey(NamedTuple):
    """Identifies a lane within one section of a road; lanelets are roads of one section and lane."""

    road: str
    section: int
    lane: int

    def __str__(self) -> str:
        return f"{self.road}/{self.section}/{self.lane}"
