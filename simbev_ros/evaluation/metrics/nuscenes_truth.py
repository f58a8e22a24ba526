"""Ground truth for the nuScenes metrics, as nuscenes-devkit 1.2.0 would see it in an export of the scene.

From the keyframes of a recorded scene, the boxes that nuScenes annotates (``annotated_boxes``: of one size, with
riders, hit by a lidar or radar) are taken if they belong to a class of its detection task and are near enough to the
ego for this class. The class is that of the exported category: a pick-up is a truck; an ambulance and a person in a
wheelchair have no class. Velocities are the devkit's, derived from positions in the neighboring keyframes.
"""

from dataclasses import dataclass, replace

import numpy as np

from simbev_ros.dataset import Scene
from simbev_ros.dataset.nuscenes.annotated_boxes import annotated_boxes
from simbev_ros.dataset.nuscenes.channels import TOP_LIDAR, channels_of
from simbev_ros.dataset.nuscenes.keyframes import keyframes_of
from simbev_ros.dataset.nuscenes.scene_taxonomy import SceneTaxonomy
from simbev_ros.evaluation.metrics.boxes import NO_ATTRIBUTE, Boxes, Predictions, boxes_from_tables
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array, Table, UInt8Array
from simbev_ros.schema.boxes import NO_CLASS
from simbev_ros.schema.nuscenes import attribute_names, detection_class_of, detection_ranges_m

ATTRIBUTES: tuple[str, ...] = tuple(attribute_names())
"""Attribute names; the boxes' attributes are indices into them."""

_MAX_INTERVAL_S = 1.5
"""Maximum time between two positions that give a velocity; twice that between the previous and the next one."""


@dataclass(frozen=True, slots=True, eq=False)
class NuscenesTruth:
    """Ground truth of one scene.

    Attributes:
        boxes: Boxes that count, map frame; ``frame`` is the tick.
        ticks: (K,) ticks of the keyframes, ascending.
        ego_m: (K, 2) position of the ego at each keyframe, map frame, x and y.
    """

    boxes: Boxes
    ticks: Int64Array
    ego_m: Float64Array

    def counted(self, predictions: Predictions) -> Predictions:
        """Predictions in the map frame that count: in keyframes, and within the range of a nuScenes class."""
        return predictions.take(_is_near(predictions.boxes, self.ticks, self.ego_m))


def nuscenes_truth(scene: Scene, keyframe_hz: float | None = 2.0) -> NuscenesTruth:
    """Ground truth of a scene for the nuScenes metrics.

    Args:
        scene: The scene.
        keyframe_hz: Rate of the keyframes; None: every frame is one.

    Raises:
        InputError: The scene has no such keyframes.
        BagError: The bag is damaged, or lacks data that an export needs.
    """
    taxonomy, ticks = SceneTaxonomy(scene), keyframes_of(scene, keyframe_hz)
    tables, numbers = dict[int, Table](), list[tuple[UInt8Array, UInt8Array]]()
    for tick in ticks.tolist():
        frame = scene[tick]  # one at a time: a frame keeps its clouds
        tables[tick] = annotated_boxes(frame)
        numbers.append(_numbers(*taxonomy.of(frame, tables[tick])))
    labels, attributes = zip(*numbers, strict=True)
    table, label = np.concatenate([*tables.values()]), np.concatenate(labels)
    boxes = boxes_from_tables(tables)
    stamp_s = (scene.stamps_ns[boxes.frame] // 1000).astype(np.float64) * 1e-6
    boxes = replace(
        boxes,
        velocity_mps=_velocities_mps(table["id"], stamp_s, boxes.center_m),
        attribute=np.concatenate(attributes),
    ).take(label != NO_CLASS)
    boxes = replace(boxes, label=label[label != NO_CLASS])
    ego_m = np.array([scene[tick]["odom"][-1]["position_m"][:2] for tick in _lidar_ticks(scene, ticks).tolist()])
    return NuscenesTruth(boxes.take(_is_near(boxes, ticks, ego_m)), ticks, ego_m)


def _numbers(categories: list[str], attributes: list[list[str]]) -> tuple[UInt8Array, UInt8Array]:
    """(N,) index into ``BOX_CLASSES`` of the class of each box, and (N,) index into ``ATTRIBUTES``."""
    classes = [detection_class_of(category) for category in categories]
    label = [BOX_CLASSES.index(name) if name in BOX_CLASSES else NO_CLASS for name in classes]
    attribute = [ATTRIBUTES.index(names[0]) if names else NO_ATTRIBUTE for names in attributes]
    return np.array(label, np.uint8), np.array(attribute, np.uint8)


def _is_near(boxes: Boxes, ticks: Int64Array, ego_m: Float64Array) -> BoolArray:
    """(N,) whether each box belongs to a keyframe and a nuScenes class, and is within the range of that class."""
    ranges_m = detection_ranges_m()
    keyframe = np.minimum(np.searchsorted(ticks, boxes.frame), len(ticks) - 1)
    offset_m = boxes.center_m[:, :2] - ego_m[keyframe]
    max_range_m = np.array([ranges_m.get(name, 0.0) for name in BOX_CLASSES])[boxes.label]
    return (np.sqrt((offset_m**2).sum(axis=1)) < max_range_m) & (ticks[keyframe] == boxes.frame)


def _lidar_ticks(scene: Scene, ticks: Int64Array) -> Int64Array:
    """(K,) ticks of the uppermost lidar's data for (K,) keyframes: the devkit takes the ego's position from there."""
    keys = [channel.key for channel in channels_of(scene) if channel.name == TOP_LIDAR]
    lidar_ticks = np.flatnonzero(scene.has(keys)) if keys else ticks
    return lidar_ticks[np.maximum(np.searchsorted(lidar_ticks, ticks, side="right") - 1, 0)]


def _velocities_mps(ids: Int64Array, stamp_s: Float64Array, center_m: Float64Array) -> Float64Array:
    """(N, 3) velocities from the boxes of the same ids before and after, or one of them; NaN: too far apart in time."""
    order = np.lexsort((stamp_s, ids))
    has_next = np.append(ids[order][1:] == ids[order][:-1], False)[: len(ids)]
    has_last, index = np.roll(has_next, 1), np.arange(len(ids))
    first, last = order[index - has_last], order[index + has_next]
    time_s = stamp_s[last] - stamp_s[first]
    known = (time_s > 0) & (time_s <= _MAX_INTERVAL_S * np.where(has_next & has_last, 2.0, 1.0))
    result = np.full((len(ids), 3), np.nan)
    result[order[known]] = (center_m[last] - center_m[first])[known] / time_s[known, None]
    return result
