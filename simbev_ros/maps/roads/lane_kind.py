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

CURB_HEIGHT_M = 0.12
"""Height of sidewalks and medians above the road, where the map states none."""

ROAD_KINDS = (LaneKind.DRIVING, LaneKind.BICYCLE, LaneKind.PARKING)
"""Kinds of lanes that are labeled as road."""

PAVED_KINDS = (*ROAD_KINDS, LaneKind.SHOULDER)
"""Kinds of lanes between the curbs."""


def raised_of(kind: LaneKind) -> float:
    """Height of lanes of a kind above the road's surface in meters, where the map states none."""
    return CURB_HEIGHT_M if kind in (LaneKind.SIDEWALK, LaneKind.WALKING_AREA, LaneKind.MEDIAN) else 0.0
