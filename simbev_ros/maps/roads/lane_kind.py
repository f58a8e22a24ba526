"""What lanes are for."""

from enum import StrEnum


class LaneKind(StrEnum):
    """What a lane is for."""

    DRIVING = "driving"
    BICYCLE = "bicycle"
    PARKING = "parking"
    SHOULDER = "shoulder"
    MEDIAN = "median"
    SIDEWALK = "sidewalk"
    CROSSING = "crossing"
    WALKING_AREA = "walking_area"


WALKABLE_KINDS = (LaneKind.SIDEWALK, LaneKind.CROSSING, LaneKind.WALKING_AREA)
"""Where pedestrians walk."""

ROAD_KINDS = (LaneKind.DRIVING, LaneKind.BICYCLE, LaneKind.PARKING)
"""What counts as road in labels."""
