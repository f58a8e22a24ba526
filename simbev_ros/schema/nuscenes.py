"""nuScenes' names for our objects: categories, attributes, classes of its detection task, and visibility levels.

Rows of /ego/boxes enter; names leave. The assignment is in ``nuscenes.yaml`` and, by class of a box, in classes.yaml.
"""

from collections.abc import Collection, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from simbev_ros.foundation.semantics import BOX_CLASSES, CLASSES, SIGN_TYPES, Tag
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import AnyArray, Table
from simbev_ros.schema.boxes import NO_BLUEPRINT
from simbev_ros.schema.scene.state import Behavior, SignalState

_MIN_MOVING_MPS = 0.2
_CYCLES = ("vehicle.motorcycle", "vehicle.bicycle")


def categories_of(boxes: Table, blueprints: Sequence[str]) -> list[str]:
    """Names of the categories of (N,) boxes; ``blueprints`` are the names that their column ``blueprint`` indexes."""
    names = ["" if blueprint == NO_BLUEPRINT else blueprints[blueprint] for blueprint in boxes["blueprint"].tolist()]
    classes = [BOX_CLASSES[box_class] for box_class in boxes["class"].tolist()]
    return [category_of_blueprint(name, box_class) or "" for name, box_class in zip(names, classes, strict=True)]


def detection_class_of(category: str) -> str | None:
    """Name of the class of nuScenes' detection task that a category belongs to, or None."""
    classes = nuscenes_names()["detection"].items()
    return next((name for name, each in classes if category in each["categories"]), None)


def detection_ranges_m() -> dict[str, float]:
    """Maximum distance to the ego at which boxes count in the detection task, by name of the class."""
    return {name: float(each["range_m"]) for name, each in nuscenes_names()["detection"].items()}


def attribute_names() -> list[str]:
    """Names of all attributes, in the order of the table ``attribute``."""
    return list(nuscenes_names()["attributes"])


def attributes_of(
    boxes: Table, categories: Sequence[str], parked: Collection[int], ridden: Collection[int]
) -> list[list[str]]:
    """Names of the attributes of (N,) boxes, at most one each, as the devkit's evaluation requires.

    Args:
        boxes: (N,) ``BOX_DTYPE`` rows.
        categories: (N,) names of their categories.
        parked: Ids of the vehicles that stand for the whole scene in addition to those whose behavior is ``PARKED``.
        ridden: Ids of the vehicles that have a rider at this frame.
    """
    is_parked = np.isin(boxes["id"], list(parked)) | (boxes["behavior"] & Behavior.PARKED > 0)
    moves = np.linalg.norm([boxes["vx"], boxes["vy"], boxes["vz"]], axis=0) > _MIN_MOVING_MPS
    return [
        _attributes(category, row, moves=bool(moving), parked=bool(stands), ridden=row["id"] in ridden)
        for row, category, moving, stands in zip(boxes, categories, moves, is_parked, strict=True)
    ]


def _attributes(category: str, row: Any, *, moves: bool, parked: bool, ridden: bool) -> list[str]:
    if category in _CYCLES:
        return ["cycle.with_rider" if ridden else "cycle.without_rider"]
    if category.startswith("vehicle."):
        return ["vehicle.moving" if moves else "vehicle.parked" if parked else "vehicle.stopped"]
    if category.startswith("human."):
        still = "sitting_lying_down" if row["behavior"] & Behavior.SITTING else "standing"
        return ["pedestrian.moving" if moves else f"pedestrian.{still}"]
    name = BOX_CLASSES[row["class"]]
    if name == "traffic_light":
        return [f"traffic_light.{SignalState(row['state']).name.lower()}"]
    if name == "traffic_sign" and row["sign"]:
        return [f"traffic_sign.{SIGN_TYPES[row['sign']]}"]
    return []


def point_labels() -> dict[str, int]:
    """Labels of points in nuScenes-lidarseg by name of the category."""
    return {name: label for label, name in enumerate(nuscenes_names()["lidarseg"])}


def category_of_tag(tag: Tag) -> str:
    """Name of the category of a static surface's points."""
    name: str = nuscenes_names()["of_tag"][tag.name]
    return name


def category_of_blueprint(name: str, box_class: str) -> str | None:
    """Name of the category of a blueprint with a box class; None: it has no boxes, as riders."""
    category: str | None = nuscenes_names()["of_blueprint"].get(name) or CLASSES.get(box_class, {}).get("nuscenes")
    return category


def visibility_tokens(visibility: AnyArray) -> list[str]:
    """Tokens of the visibility levels of (N,) visible shares; boxes in no image (NaN) have the lowest level."""
    levels = nuscenes_names()["visibility"]
    edges = [each["from"] for each in levels[1:]]
    indices = np.searchsorted(edges, np.nan_to_num(visibility), side="right")
    return [levels[index]["token"] for index in indices.tolist()]


@lru_cache(maxsize=1)
def nuscenes_names() -> dict[str, Any]:
    """The tables of nuscenes.yaml."""
    return load_table("simbev_ros.schema", "nuscenes.yaml")
