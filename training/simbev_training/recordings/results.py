"""Writes boxes for other programs: one table, KITTI's results, and nuScenes' of its detection and tracking tasks."""

import csv
import io
import json
from typing import Any

import numpy as np

from simbev_ros.baselines.recordings.model_inputs import FrameView, Photo
from simbev_ros.baselines.recordings.recording import RecordedFrame, boxes_in_frame
from simbev_ros.baselines.tracker import Tracker
from simbev_ros.evaluation.metrics.boxes import NO_TRACK
from simbev_ros.foundation.geometry.transforms import apply, inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.foundation.units import NS_PER_S

NUMBERS = ("x", "y", "z", "length", "width", "height", "yaw", "vx", "vy", "score")
TABLE_HEAD = f"frame,class,{','.join(NUMBERS)}\n"
"""First line of the table."""
_KITTI_TYPES = {"car": "Car", "truck": "Truck", "pedestrian": "Pedestrian", "bicycle": "Cyclist", "bus": "Bus"}
_CORNERS = np.array([[x, y, z] for x in (0.5, -0.5) for y in (0.5, -0.5) for z in (-0.5, 0.5)])
_MOVING_MPS = 0.2
_MIN_AHEAD_M = 0.1


def table_lines(name: str, boxes: Table) -> str:
    """Lines of the table for a frame.

    Args:
        name: Name of the frame.
        boxes: (N,) ``baselines.boxes.BOX_DTYPE``, lidar frame.
    """
    text = io.StringIO()
    rows = ([name, BOX_CLASSES[box["class"]], *(f"{box[column]:.4f}" for column in NUMBERS)] for box in boxes)
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def kitti_lines(boxes: Table, photo: Photo) -> str:
    """Lines of KITTI's results for the boxes that an image shows: as labels, with a score at the end.

    Args:
        boxes: (N,) ``baselines.boxes.BOX_DTYPE``, ego frame.
        photo: The image.
    """
    sides_px = _sides_px(boxes, photo)
    bottom = np.stack([boxes["x"], boxes["y"], boxes["z"]], 1) - boxes["height"][:, None] / 2.0 * [0.0, 0.0, 1.0]
    bottom = apply(photo.optical_from_ego, bottom.astype(np.float64)) - photo.reference_m
    yaw_rad = boxes["yaw"].astype(np.float64)
    ahead = np.stack([np.cos(yaw_rad), np.sin(yaw_rad), np.zeros(len(boxes))], 1) @ photo.optical_from_ego[:3, :3].T
    rotation_y = np.arctan2(-ahead[:, 2], ahead[:, 0])
    alpha = np.angle(np.exp(1j * (rotation_y - np.arctan2(bottom[:, 0], bottom[:, 2]))))
    size_m = np.stack([boxes["height"], boxes["width"], boxes["length"]], 1)
    numbers = np.column_stack([alpha, sides_px, size_m, bottom, rotation_y, boxes["score"]])
    shown = np.all(sides_px[:, :2] < sides_px[:, 2:], axis=1)
    names = [_KITTI_TYPES.get(BOX_CLASSES[label], "Misc") for label in boxes["class"].tolist()]
    return "".join(
        f"{name} -1 -1 {' '.join(f'{number:.4f}' for number in row)}\n"
        for name, row, is_shown in zip(names, numbers.tolist(), shown.tolist(), strict=True)
        if is_shown
    )


def nuscenes_results(boxes: Table, frame: RecordedFrame, view: FrameView) -> list[dict[str, Any]]:
    """Boxes of a key frame as nuScenes' evaluation takes them: in the map's frame.

    Args:
        boxes: (N,) ``baselines.boxes.BOX_DTYPE``, ego frame.
        frame: The frame, whose name is the token of its sample.
        view: What the frame shows.
    """
    return [
        {
            **_nuscenes_box(row, frame),
            "detection_name": BOX_CLASSES[row["class"]],
            "detection_score": float(row["score"]),
            "attribute_name": _attribute(BOX_CLASSES[row["class"]], float(np.hypot(row["vx"], row["vy"]))),
        }
        for row in _boxes_in_map(boxes, frame, view)
    ]


def nuscenes_tracks(boxes: Table, frame: RecordedFrame, view: FrameView, tracker: Tracker) -> list[dict[str, Any]]:
    """Boxes of a key frame that have tracks, with velocities of these, as nuScenes' tracking evaluation takes them.

    That allows 500 boxes in a frame, which models do not have.

    Args:
        boxes: (N,) ``baselines.boxes.BOX_DTYPE``, ego frame.
        frame: The frame.
        view: What the frame shows.
        tracker: The tracker, which has seen the earlier frames of the scene.
    """
    rows = _boxes_in_map(boxes, frame, view)
    tracked = tracker.step(rows, frame.sweep.stamp_ns / NS_PER_S)
    rows["vx"], rows["vy"] = tracked.velocity_mps.T
    return [
        {
            **_nuscenes_box(row, frame),
            "tracking_id": str(track),
            "tracking_name": BOX_CLASSES[row["class"]],
            "tracking_score": float(row["score"]),
        }
        for row, track in zip(rows, tracked.id.tolist(), strict=True)
        if track != NO_TRACK
    ]


def nuscenes_text(results: dict[str, list[dict[str, Any]]], *, has_cameras: bool, has_lidar: bool) -> str:
    """The file of nuScenes' results."""
    used = {"use_camera": has_cameras, "use_lidar": has_lidar}
    meta = {**used, "use_radar": False, "use_map": False, "use_external": True}
    return json.dumps({"meta": meta, "results": results})


def _boxes_in_map(boxes: Table, frame: RecordedFrame, view: FrameView) -> Table:
    assert frame.sweep.map_from_lidar is not None
    return boxes_in_frame(boxes, frame.sweep.map_from_lidar @ inverse(view.ego_from_lidar))


def _nuscenes_box(row: Any, frame: RecordedFrame) -> dict[str, Any]:
    """The fields that detections and tracks have in common."""
    return {
        "sample_token": frame.name,
        "translation": [float(row[axis]) for axis in ("x", "y", "z")],
        "size": [float(row[side]) for side in ("width", "length", "height")],
        "rotation": [float(np.cos(row["yaw"] / 2.0)), 0.0, 0.0, float(np.sin(row["yaw"] / 2.0))],
        "velocity": [float(row["vx"]), float(row["vy"])],
    }


def _attribute(name: str, speed_mps: float) -> str:
    """The likely attribute; riders are not predicted as parts of two-wheelers."""
    moves = speed_mps > _MOVING_MPS
    if name == "pedestrian":
        return f"pedestrian.{'moving' if moves else 'standing'}"
    if name in ("bicycle", "motorcycle"):
        return f"cycle.{'with' if moves else 'without'}_rider"
    return f"vehicle.{'moving' if moves else 'parked'}"


def _sides_px(boxes: Table, photo: Photo) -> Float64Array:
    """(N, 4) left, top, right, bottom of boxes in an image, cut off at its edges; zeros behind the camera."""
    count = len(boxes)
    xyz_m = np.stack([boxes["x"], boxes["y"], boxes["z"]], 1)
    rpy_rad = np.stack([np.zeros(count), np.zeros(count), boxes["yaw"]], 1)
    poses = photo.optical_from_ego @ matrices_from_xyz_rpy(xyz_m, rpy_rad)
    size_m = np.stack([boxes["length"], boxes["width"], boxes["height"]], 1).astype(np.float64)
    corners = (_CORNERS * size_m[:, None]) @ poses[:, :3, :3].swapaxes(1, 2) + poses[:, None, :3, 3]
    ahead = (corners[..., 2] > _MIN_AHEAD_M).all(1)
    corners[~ahead] = 1.0
    pixels = photo.camera.project(corners.reshape(-1, 3)).reshape(count, 8, 2)
    limit = np.array([photo.camera.width_px, photo.camera.height_px]) - 1.0
    sides = np.concatenate([pixels.min(1), pixels.max(1)], 1).clip(0.0, np.tile(limit, 2))
    sides[~ahead] = 0.0
    return sides
