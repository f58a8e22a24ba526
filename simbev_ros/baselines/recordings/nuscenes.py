"""Reads nuScenes' layout, without its devkit: the tables of a version, and the files that they name.

The schema is documented at https://www.nuscenes.org/nuscenes#data-format. The ego's frame is on the ground there.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from simbev_ros.baselines.boxes import BOX_DTYPE
from simbev_ros.baselines.recordings.recording import (
    Labels,
    RecordedFrame,
    RecordedImage,
    RecordedSweep,
    class_numbers,
    path_below,
    require_matrix,
    require_possible,
    require_rigid,
)
from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_ros.foundation.files.input_file import is_file, is_folder, read_small_file
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.geometry.transforms import inverse, matrices_from_xyz_quaternion
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.foundation.units import NS_PER_S

LIDAR = "LIDAR_TOP"
_COLUMNS = 5
_NS_PER_US = NS_PER_S // 1_000_000
_MAX_STAMP_US = 1 << 53
_MAX_BYTES = 4 << 30
_FIELDS = {
    "sensor": "token channel",
    "calibrated_sensor": "token sensor_token translation rotation camera_intrinsic",
    "ego_pose": "token translation rotation",
    "scene": "token name",
    "sample": "token scene_token",
    "sample_data": "sample_token ego_pose_token calibrated_sensor_token timestamp filename is_key_frame",
    "category": "token name",
    "instance": "token category_token",
    "sample_annotation": "sample_token instance_token translation size rotation",
}
"""Fields of the tables that are read; the last three need not be there."""
_SIDES = ("_LEFT", "", "_RIGHT")
_CAMERAS = [f"CAM_{end}{side}" for end in ("FRONT", "BACK") for side in _SIDES]

_Row = Mapping[str, Any]


def nuscenes_frames(folder: Path, version: str) -> list[RecordedFrame]:
    """The key frames whose cloud is there, by names of scenes and by time. They are called by tokens of samples.

    Args:
        folder: Folder with ``samples``, ``sweeps`` and that of the version.
        version: Name of the folder of the tables, such as ``v1.0-mini``.

    Raises:
        InputError: A table is missing or damaged, or no cloud is there.
    """
    if not is_folder(folder / version):
        there = sorted(path.parent.name for path in folder.glob("*/sample_data.json"))
        raise InputError(f"{folder}: has no {version}; --version can be {', '.join(there) or 'a folder with tables'}")
    with foreign_content(folder / version):
        frames = list(_Tables(folder, version).frames())
    if not frames:
        raise InputError(f"{folder}: has none of the clouds that {version} names")
    return frames


class _Tables:
    """The tables of a version: rows by token, or of one sample."""

    def __init__(self, folder: Path, version: str) -> None:
        self._folder = folder
        self._rows: dict[str, dict[str, Any]] = {}
        self.has_labels = is_file(folder / version / "sample_annotation.json")
        for name in list(_FIELDS)[: None if self.has_labels else -3]:
            fields, table = _FIELDS[name].split(), self._rows.setdefault(name, {})
            for row in _read_table(folder / version / f"{name}.json", fields):
                if "token" in fields:
                    table[row["token"]] = row
                else:
                    table.setdefault(row["sample_token"], []).append(row)

    def frames(self) -> Iterator[RecordedFrame]:
        """Yield the frames."""
        turns: dict[str, list[_Row]] = defaultdict(list)
        for sample, rows in self._rows["sample_data"].items():
            turns[self._rows["sample"][sample]["scene_token"]] += [row for row in rows if self._channel(row) == LIDAR]
        for name, token in sorted((str(self._rows["scene"][token]["name"]), token) for token in turns):
            there = [row for row in turns[token] if is_file(path_below(self._folder, row["filename"]))]
            yield from self._frames_of_scene(name, sorted(there, key=_stamp_ns))

    def _frames_of_scene(self, name: str, turns: Sequence[_Row]) -> Iterator[RecordedFrame]:
        sweeps = [
            RecordedSweep(self._folder / row["filename"], _COLUMNS, _stamp_ns(row), self._map_from_sensor(row))
            for row in turns
        ]
        keys = [index for index, row in enumerate(turns) if row["is_key_frame"]]
        for number, index in enumerate(keys):
            sample, map_from_lidar = turns[index]["sample_token"], self._map_from_sensor(turns[index])
            yield RecordedFrame(
                name=sample,
                title=f"nuScenes {name}, key frame {number}",
                sweeps=sweeps,
                index=index,
                images=partial(self._images, sample, map_from_lidar),
                labels=partial(self._labels, sample, inverse(map_from_lidar)) if self.has_labels else None,
                ego_from_lidar=_matrix(self._of("calibrated_sensor", turns[index])),
            )

    def _of(self, table: str, row: _Row) -> _Row:
        """The row of a table that another row refers to."""
        found: _Row = self._rows[table][row[f"{table}_token"]]
        return found

    def _channel(self, row: _Row) -> str:
        return str(self._of("sensor", self._of("calibrated_sensor", row))["channel"])

    def _map_from_sensor(self, row: _Row) -> Float64Array:
        return _matrix(self._of("ego_pose", row)) @ _matrix(self._of("calibrated_sensor", row))

    def _images(self, sample: str, map_from_lidar: Float64Array) -> list[RecordedImage]:
        """Images that are there, each by where its camera was when it was taken."""
        found = []
        with foreign_content(self._folder):
            rows = {self._channel(row): row for row in self._rows["sample_data"][sample] if row["is_key_frame"]}
            for name, row in ((name, rows[name]) for name in _CAMERAS if name in rows):
                path = path_below(self._folder, row["filename"])
                matrix = require_matrix(np.array(self._of("calibrated_sensor", row)["camera_intrinsic"], np.float64))
                optical_from_lidar = inverse(self._map_from_sensor(row)) @ map_from_lidar
                found += [RecordedImage(name, path, matrix, optical_from_lidar)] if is_file(path) else []
        return found

    def _labels(self, sample: str, lidar_from_map: Float64Array) -> Labels:
        numbers_of, boxes = class_numbers("nuscenes"), [np.zeros(0, BOX_DTYPE)]
        with foreign_content(self._folder):
            for row in self._rows["sample_annotation"].get(sample, ()):
                name = self._of("category", self._of("instance", row))["name"]
                boxes += [_box(numbers_of[name], row, lidar_from_map)] if name in numbers_of else []
            return Labels(require_possible(np.concatenate(boxes)))


def _box(label: int, row: _Row, lidar_from_map: Float64Array) -> Table:
    """(1,) ``BOX_DTYPE`` of an annotation, whose size is width, length, height."""
    pose, box = lidar_from_map @ _matrix(row), np.zeros(1, BOX_DTYPE)
    box["x"], box["y"], box["z"] = pose[:3, 3]
    box["width"], box["length"], box["height"] = np.array(row["size"], np.float64)
    box["yaw"], box["class"] = np.arctan2(pose[1, 0], pose[0, 0]), label
    return box


def _stamp_ns(row: _Row) -> int:
    stamp_us = row["timestamp"]
    if type(stamp_us) is not int or not 0 <= stamp_us < _MAX_STAMP_US:
        raise ValueError(f"sample_data: timestamp: is {stamp_us!r:.80}; allowed: whole microseconds")
    return stamp_us * _NS_PER_US


def _matrix(row: _Row) -> Float64Array:
    """(4, 4) transform of a row with a translation in m, and a rotation w x y z."""
    position, (w, *xyz) = np.array(row["translation"], np.float64), np.array(row["rotation"], np.float64)
    return require_rigid(
        matrices_from_xyz_quaternion(position, np.array([*xyz, w]) / max(float(np.linalg.norm([*xyz, w])), 1e-9))
    )


def _read_table(path: Path, fields: Sequence[str]) -> list[_Row]:
    """Rows of a table with the fields that are needed, which are a small part of the large tables."""
    with foreign_content(path):
        rows = parse_json(read_small_file(path, _MAX_BYTES))
        if not isinstance(rows, list):
            raise ValueError("it is not a list")
        for number, row in enumerate(rows):
            missing = [name for name in fields if not isinstance(row, dict) or name not in row]
            if missing:
                raise ValueError(f"row {number} has no {', '.join(missing)}")
        return [{name: row[name] for name in fields} for row in rows]
