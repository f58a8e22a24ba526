"""Reads from an export where nuScenes' global frame lies in the frame ``map`` of each scene, for the way back.

nuScenes' coordinates cannot be negative, as they are looked up in the picture of a map. So they are relative to the
lower left corner of that picture, ``origin_m`` in the table ``map``. Tables enter; an origin for each scene leaves.
"""

import json
from pathlib import Path
from typing import Any

from simbev_ros.export.nuscenes.taxonomy import Record
from simbev_ros.foundation.errors import InputError

VERSION = "v1.0-trainval"
"""Name of the folder of tables, unless another one is chosen."""


def origins_by_scene(dataroot: Path | str, version: str = VERSION) -> dict[str, tuple[float, float]]:
    """The origin of nuScenes' global frame, x and y in the frame ``map`` in meters, by name of the scene.

    The frames have the same axes and heights, so ``x_map = x_global + origin[0]`` and ``y_map = y_global + origin[1]``.

    Args:
        dataroot: Folder of the export.
        version: Name of its folder of tables.

    Raises:
        InputError: The folder is not an export by ``simbev export nuscenes``.
    """
    folder = Path(dataroot) / version
    origin_by_log = {
        log: _origin(record, folder / "map.json")
        for record in _table(folder / "map.json")
        for log in record.get("log_tokens", ())
    }
    try:
        return {each["name"]: origin_by_log[each["log_token"]] for each in _table(folder / "scene.json")}
    except KeyError as error:
        raise InputError(f"{folder / 'scene.json'}: {error} is missing, or a log that has no map") from None


def _origin(record: Record, path: Path) -> tuple[float, float]:
    match record.get("origin_m"):
        case [int() | float() as x_m, int() | float() as y_m]:
            return float(x_m), float(y_m)
        case _:
            raise InputError(f"{path}: a map has no origin_m; simbev export nuscenes writes it")


def _table(path: Path) -> list[Record]:
    try:
        records: Any = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: is not a table in nuScenes' layout: {error}") from None
    if not (isinstance(records, list) and all(isinstance(record, dict) for record in records)):
        raise InputError(f"{path}: is not a table in nuScenes' layout: it is not a list of objects")
    return records
