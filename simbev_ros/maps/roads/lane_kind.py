"""The kinds of lanes, by use."""

from enum import StrEnum


class LaneKind(StrEnum):
    """Use of a lane."""

    DRIVING = "driving"
    BICYCLE = "bicycle"
    PARKING = "parking"
    SHOULDER = "shoulder"
    MEDIAN = "median"
    SIDEWALK = "sidewalk"
    CROSSING = "crossing"
    WALKING_AREA = "walking_area"


WALKABLE_KINDS = (LaneKind.SIDEWALK, LaneKind.CROSSING, LaneKind.WALKING_AREA)
"""Kinds of lanes that pedestrians walk on."""

ROAD_KINDS = (LaneKind.DRIVING, LaneKind.BICYCLE, LaneKind.PARKING)
"""Kinds of lanes that are labeled as road."""

PAVED_KINDS = (*ROAD_KINDS, LaneKind.SHOULDER)
"""Kinds of lanes between the curbs."""
