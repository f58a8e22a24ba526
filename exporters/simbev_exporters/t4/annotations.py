"""T4's names for the boxes of a scene, and the rows of its tables that list names.

Boxes, categories and attributes of nuScenes' layout enter; those of T4 leave. The assignment is in ``names.yaml``.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from simbev_exporters.nuscenes.annotations import DECIMALS, Annotations
from simbev_exporters.nuscenes.taxonomy import Record, token
from simbev_ros.dataset import Frame, Scene, columns
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Table, UInt8Array
from simbev_ros.schema.boxes import NO_BLUEPRINT
from simbev_ros.schema.nuscenes import point_labels
from simbev_ros.schema.scene.state import Light


class T4Annotations(Annotations):
    """The 3D annotations of one scene, with exact velocities, and the objects' 2D annotations in images."""

    def __init__(self, scene: Scene, *, keep_unhit: bool = False) -> None:
        super().__init__(scene, keep_unhit=keep_unhit)
        self._name = scene.name
        self._blueprints = [str(each["name"]) for each in scene.constants["world/legend"]["blueprints"]]

    def keys_of(self, box_id: int) -> Record:
        """Tokens of the instance and the category of a box that was annotated."""
        instance = token("instance", self._scene_token, box_id)
        return {"instance_token": instance, "category_token": token("category", self._category[box_id])}

    def attributes_at(self, sample_token: str) -> dict[int, list[str]]:
        """Tokens of the attributes of the boxes of a sample that was added, by id of the box."""
        return {
            box_id: chain[-1]["attribute_tokens"]
            for box_id, chain in self._found.items()
            if chain and chain[-1]["sample_token"] == sample_token
        }

    def _named_boxes(self, frame: Frame) -> tuple[Table, list[str], list[list[str]]]:
        boxes, categories, attributes = super()._named_boxes(frame)
        named = [self._category_of(box, name) for box, name in zip(boxes, categories, strict=True)]
        kept = [index for index, name in enumerate(named) if name]
        chosen = [list(_attributes(boxes[index], named[index], attributes[index])) for index in kept]
        return boxes[kept], [named[index] for index in kept], chosen

    def _category_of(self, box: Any, category: str) -> str:
        """T4's category of a box; "" if it is not annotated."""
        names, number = t4_names(), int(box["blueprint"])
        blueprint = "" if number == NO_BLUEPRINT else self._blueprints[number]
        return str(names["of_blueprint"].get(blueprint) or names["categories"].get(category, ""))

    def _values(self, boxes: Table) -> dict[str, list[Any]]:
        return {
            **super()._values(boxes),
            "visibility_token": [token("visibility", level) for level in visibility_levels(boxes)],
            "velocity": columns(boxes, "vx", "vy", "vz").astype(np.float64).round(DECIMALS).tolist(),
            "acceleration": columns(boxes, "ax", "ay", "az").astype(np.float64).round(DECIMALS).tolist(),
            "automatic_annotation": [False] * len(boxes),
        }

    def _instance(self, annotations: Sequence[Record], box_id: int) -> Record:
        return {**super()._instance(annotations, box_id), "instance_name": f"{self._name}::{box_id}"}


def name_tables(*, lidarseg: bool = False) -> dict[str, list[Record]]:
    """Rows of the tables ``category``, ``attribute`` and ``visibility``, by name of the table.

    Args:
        lidarseg: Whether the categories are also those of points, with the ``index`` that labels have.
    """
    names = t4_names()
    categories = point_categories() if lidarseg else _box_categories()
    attributes = dict.fromkeys([*names["attributes"].values(), *_lamp_names()])
    rows = [{"token": token("category", name), "name": name, "description": ""} for name in categories]
    return {
        "category": [{**row, "index": index} for index, row in enumerate(rows)] if lidarseg else rows,
        "attribute": [{"token": token("attribute", name), "name": name, "description": ""} for name in attributes],
        "visibility": [
            {"token": token("visibility", each["level"]), "level": each["level"], "description": each["means"]}
            for each in names["visibility"]
        ],
    }


def visibility_levels(boxes: Table) -> list[str]:
    """Names of the visibility levels of (N,) boxes; those in no image have the lowest one."""
    levels = t4_names()["visibility"]
    edges = [each["from"] for each in levels[1:]]
    indices = np.searchsorted(edges, np.nan_to_num(boxes["visibility"]), side="right")
    return [levels[index]["level"] for index in indices.tolist()]


def point_categories() -> list[str]:
    """Names of the categories of lidar points in the order of their labels; surfaces have nuScenes' names."""
    return [*dict.fromkeys([*_category_of_label(), *_box_categories()])]


def t4_labels(labels: UInt8Array) -> UInt8Array:
    """(N,) labels of points from those of nuScenes-lidarseg; a fire engine's points are those of a truck."""
    index = {name: label for label, name in enumerate(point_categories())}
    return np.array([index[name] for name in _category_of_label()], np.uint8)[labels]


def _category_of_label() -> list[str]:
    """T4's category of each label of nuScenes-lidarseg."""
    return [t4_names()["categories"].get(name, name) for name in point_labels()]


def _box_categories() -> list[str]:
    names = t4_names()
    return [*dict.fromkeys([*names["categories"].values(), *names["of_blueprint"].values()])]


@lru_cache(maxsize=1)
def t4_names() -> dict[str, Any]:
    """The tables of names.yaml."""
    return load_table("simbev_exporters.t4", "names.yaml")


def _attributes(box: Any, category: str, attributes: Sequence[str]) -> Iterator[str]:
    """Names of the attributes of a box, from nuScenes' attributes and its lights."""
    names = t4_names()
    states = [names["attributes"][each] for each in attributes if each in names["attributes"]]
    yield from states
    if any(state.startswith("vehicle_state.") for state in states) and category != "trailer":
        for flag, lamp in names["lamps"].items():
            yield f"{lamp}.{'on' if int(box['lights']) & Light[flag] else 'off'}"


def _lamp_names() -> list[str]:
    return [f"{lamp}.{state}" for lamp in t4_names()["lamps"].values() for state in ("on", "off")]
