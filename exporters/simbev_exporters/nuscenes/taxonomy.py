"""Tokens of nuScenes' rows, and the tables that list categories, attributes and visibility levels."""

import hashlib
from typing import Any

from simbev_ros.dataset import Scene
from simbev_ros.schema.nuscenes import nuscenes_names, point_labels

Record = dict[str, Any]
"""One row of a nuScenes table."""


def token(*parts: object) -> str:
    """Token of the object that ``parts`` identify, the same in every export: 32 hexadecimal digits like nuScenes'."""
    return hashlib.md5("/".join(map(str, parts)).encode(), usedforsecurity=False).hexdigest()


def scene_token(scene: Scene) -> str:
    """Token of a scene."""
    return token("scene", scene.name, scene.spec.seed)


def sample_data_token(of_scene: str, channel: str, tick: int) -> str:
    """Token of the data of a channel at a tick in the scene with a token."""
    return token("sample_data", of_scene, channel, tick)


def taxonomy_tables(*, lidarseg: bool = False) -> dict[str, list[Record]]:
    """Rows of the tables ``category``, ``attribute`` and ``visibility``, by name of the table.

    Args:
        lidarseg: Whether the categories are also those of points, with the ``index`` that labels have.
    """
    tables = nuscenes_names()
    levels = tables["visibility"]
    return {
        "category": _categories(lidarseg=lidarseg),
        "attribute": [_named("attribute", name, text) for name, text in tables["attributes"].items()],
        "visibility": [
            {"token": each["token"], "level": each["level"], "description": f"visible share of pixels: {each['level']}"}
            for each in levels
        ],
    }


def _categories(*, lidarseg: bool) -> list[Record]:
    tables = nuscenes_names()
    records = [_named("category", name, text) for name, text in tables["categories"].items()]
    if lidarseg:
        records += [_named("category", name, text) for name, text in tables["lidarseg_only"].items()]
        labels = point_labels()
        records = [{**record, "index": labels[record["name"]]} for record in records]
    return records


def _named(table: str, name: str, description: str) -> Record:
    return {"token": token(table, name), "name": name, "description": description}
