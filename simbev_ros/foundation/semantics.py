"""Label vocabulary of the whole system: semantic tags (CARLA's numbering), BEV classes and box classes."""

from enum import IntEnum


class Tag(IntEnum):
    """Semantic tag of a surface, with the numbering of CARLA 0.9.14 and later."""

    UNLABELED = 0
    ROAD = 1
    SIDEWALK = 2
    BUILDING = 3
    WALL = 4
    FENCE = 5
    POLE = 6
    TRAFFIC_LIGHT = 7
    TRAFFIC_SIGN = 8
    VEGETATION = 9
    TERRAIN = 10
    SKY = 11
    PEDESTRIAN = 12
    RIDER = 13
    CAR = 14
    TRUCK = 15
    BUS = 16
    TRAIN = 17
    MOTORCYCLE = 18
    BICYCLE = 19
    STATIC = 20
    DYNAMIC = 21
    OTHER = 22
    WATER = 23
    ROAD_LINE = 24
    GROUND = 25
    BRIDGE = 26
    RAIL_TRACK = 27
    GUARD_RAIL = 28


BEV_CLASSES: tuple[str, ...] = (
    "road",
    "hazard",
    "road_line",
    "sidewalk",
    "crosswalk",
    "traffic_cone",
    "barrier",
    "car",
    "truck",
    "bus",
    "motorcycle",
    "bicycle",
    "rider",
    "pedestrian",
)
"""Bird's-eye-view classes in bit order: class ``k`` is bit ``k`` of a label cell."""

BOX_CLASSES: tuple[str, ...] = (
    "car",
    "truck",
    "bus",
    "motorcycle",
    "bicycle",
    "pedestrian",
    "traffic_light",
    "traffic_sign",
    "traffic_cone",
    "barrier",
)
"""Classes of 3-D detection boxes; ``truck`` includes vans and HGVs."""

DIFFICULTIES: tuple[str, ...] = ("easy", "medium", "hard")
"""Difficulty levels of detecting a box."""

SIGN_TYPES: tuple[str, ...] = ("", "stop", "yield", "speed_limit", "works", "accident")
"""Sign types: no sign, signs that are part of the map, and signs that warn of hazards."""
