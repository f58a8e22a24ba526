"""Label vocabulary of the whole system: semantic tags (CARLA's numbering), BEV classes and box classes."""

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

from simbev_ros.foundation.tables import load_table


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


CLASSES: Mapping[str, Mapping[str, Any]] = load_table("simbev_ros.foundation", "classes.yaml")
"""Rows of classes.yaml, all that is known of a class, by name; in the order in which the grid is painted."""


def _in_order_of(column: str) -> tuple[str, ...]:
    """Names of the classes that have a number in a column; the numbers count from 0, as they are indices."""
    numbers = {row[column]: name for name, row in CLASSES.items() if column in row}
    assert sorted(numbers) == [*range(len(numbers))], f"classes.yaml: {column}: numbers must count from 0 without gaps"
    return tuple(numbers[index] for index in range(len(numbers)))


BEV_CLASSES: tuple[str, ...] = _in_order_of("bit")
"""Bird's-eye-view classes in bit order: class ``k`` is bit ``k`` of a label cell. Bags have the bits: append only."""

BOX_CLASSES: tuple[str, ...] = _in_order_of("box")
"""Classes of 3-D detection boxes; ``truck`` includes vans and HGVs. Bags have the indices: append only."""

MOVING_CLASSES: tuple[str, ...] = tuple(name for name in BOX_CLASSES if "moves" in CLASSES[name])
"""Classes of boxes that take part in traffic."""

PAPER_CLASSES: tuple[str, ...] = ("road", *MOVING_CLASSES, "rider")
"""Classes of boxes and cells that the paper evaluates: six of boxes, eight of cells."""

MOTOR_CLASSES: tuple[str, ...] = tuple(name for name in MOVING_CLASSES if CLASSES[name]["moves"] == "motor")
"""Classes of vehicles with a motor."""

DIFFICULTIES: tuple[str, ...] = ("easy", "medium", "hard")
"""Difficulty levels of detecting a box."""

SIGN_TYPES: tuple[str, ...] = ("", "stop", "yield", "speed_limit", "works", "accident")
"""Sign types: no sign, signs that are part of the map, and signs that warn of hazards."""
