"""Converts the boxes of a scene's keyframes to the rows of nuScenes' tables ``sample_annotation`` and ``instance``."""

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np

from simbev_exporters.nuscenes.channel_records import wxyz
from simbev_exporters.nuscenes.taxonomy import Record, scene_token, token
from simbev_ros.dataset import Frame, Scene, columns
from simbev_ros.dataset.nuscenes.annotated_boxes import annotated_boxes
from simbev_ros.dataset.nuscenes.scene_taxonomy import SceneTaxonomy
from simbev_ros.export.quaternions import continuous
from simbev_ros.foundation.geometry.transforms import quaternion_from_rpy
from simbev_ros.foundation.types import Table
from simbev_ros.schema.nuscenes import visibility_tokens

DECIMALS = 9
"""Number of decimals of lengths in meters and of the components of quaternions."""


class Annotations:
    """The annotations of one scene, collected keyframe by keyframe.

    Args:
        scene: The scene.
        keep_unhit: Whether boxes without lidar and radar points are annotated.
    """

    def __init__(self, scene: Scene, *, keep_unhit: bool = False) -> None:
        self._scene_token, self._keep_unhit = scene_token(scene), keep_unhit
        self._taxonomy = SceneTaxonomy(scene)
        self._found: defaultdict[int, list[Record]] = defaultdict(list)
        self._category: dict[int, str] = {}

    def add(self, sample_token: str, frame: Frame) -> None:
        """Add the boxes of the next keyframe."""
        boxes, categories, attributes = self._named_boxes(frame)
        ids, values = boxes["id"].tolist(), self._values(boxes)
        self._category.update(zip(ids, categories, strict=True))
        records = (dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=True))
        for box_id, names, record in zip(ids, attributes, records, strict=True):
            keys = {
                "token": token("sample_annotation", sample_token, box_id),
                "sample_token": sample_token,
                "instance_token": token("instance", self._scene_token, box_id),
                "attribute_tokens": [token("attribute", name) for name in names],
            }
            self._found[box_id].append({**keys, **record})

    def tables(self) -> dict[str, list[Record]]:
        """The scene's rows of the tables ``sample_annotation``, with positions in the map frame, and ``instance``."""
        chains = {box_id: self._found[box_id] for box_id in sorted(self._found)}
        for chain in chains.values():
            link(chain)
            make_continuous(chain, "rotation")
        return {
            "sample_annotation": [record for chain in chains.values() for record in chain],
            "instance": [self._instance(chain, box_id) for box_id, chain in chains.items()],
        }

    def _named_boxes(self, frame: Frame) -> tuple[Table, list[str], list[list[str]]]:
        """Boxes of a frame, and for each the name of its category and those of its attributes."""
        boxes = annotated_boxes(frame, keep_unhit=self._keep_unhit)
        return boxes, *self._taxonomy.of(frame, boxes)

    def _values(self, boxes: Table) -> dict[str, list[Any]]:
        """Columns that depend on the boxes alone. Lidar points are -1 if neither lidar nor radar data were received."""
        unknown = (boxes["lidar_points"] < 0) & (boxes["radar_points"] < 0)
        return {
            "visibility_token": visibility_tokens(boxes["visibility"]),
            "translation": columns(boxes, "x", "y", "z").round(DECIMALS).tolist(),
            "size": columns(boxes, "width", "length", "height").astype(np.float64).round(DECIMALS).tolist(),
            "rotation": wxyz(quaternion_from_rpy(columns(boxes, "roll", "pitch", "yaw"))).round(DECIMALS).tolist(),
            "num_lidar_pts": np.where(unknown, -1, np.maximum(boxes["lidar_points"], 0)).tolist(),
            "num_radar_pts": np.maximum(boxes["radar_points"], 0).tolist(),
        }

    def _instance(self, annotations: Sequence[Record], box_id: int) -> Record:
        return {
            "token": annotations[0]["instance_token"],
            "category_token": token("category", self._category[box_id]),
            "nbr_annotations": len(annotations),
            "first_annotation_token": annotations[0]["token"],
            "last_annotation_token": annotations[-1]["token"],
        }


def link(records: Sequence[Record]) -> None:
    """Link records, which are in order of time: add the tokens of the previous and the next one, in place."""
    tokens = ["", *(record["token"] for record in records), ""]
    for index, record in enumerate(records):
        record["prev"], record["next"] = tokens[index], tokens[index + 2]


def make_continuous(records: Sequence[Record], name: str) -> None:
    """Choose the signs of quaternions w x y z of records, which are in order of time, in place: without jumps."""
    for record, quaternion in zip(records, continuous([record[name] for record in records]).tolist(), strict=True):
        record[name] = quaternion
