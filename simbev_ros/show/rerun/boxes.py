"""Draws 3D boxes: the truth by class, where each object will be, and the boxes that a perception stack predicts."""

from collections.abc import Callable, Iterator

import numpy as np
import rerun as rr

from simbev_ros.dataset.calibration import calibrations
from simbev_ros.dataset.values import columns, poses_from_odometry
from simbev_ros.evaluation.predictions.predicted_boxes import boxes_in_map
from simbev_ros.evaluation.predictions.prediction_messages import BOX_TYPES, message_boxes
from simbev_ros.evaluation.predictions.reference_frames import AgentPoses, ReferenceFrames
from simbev_ros.foundation.geometry.transforms import quaternion_from_rpy
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.foundation.units import S_PER_NS
from simbev_ros.schema.boxes import LIGHT_IDS
from simbev_ros.schema.palette import class_color
from simbev_ros.schema.scene.agents import agent_views
from simbev_ros.schema.trajectories import futures
from simbev_ros.show.rerun.scene_log import WORLD, SceneLog
from simbev_ros.show.rerun.strokes import THIN_LINE
from simbev_ros.show.rerun.subject import Samples, Subject

BOXES, PREDICTED_BOXES = f"{WORLD}/boxes", f"{WORLD}/prediction/boxes"
_HORIZON_S, _STEP_S = 3.0, 0.25
_MIN_MOVE_M = 1.0
"""Minimum length of a future path that is drawn."""
_PREDICTED_COLOR = (255, 255, 255)


class BoxDrawing:
    """Draws the boxes of each class as an entity of its own."""

    def __init__(self, log: SceneLog, subject: Subject) -> None:
        self._log, self._tracks = log, subject.tracks

    def draw(self, samples: Samples) -> None:
        """Log the boxes, and paths of those that move."""
        if "boxes" not in samples:
            return
        boxes = samples["boxes"]
        for label, name in enumerate(BOX_CLASSES):
            self._draw_class(name, boxes[boxes["class"] == label])
        if self._tracks is not None:
            self._draw_futures(boxes, samples.stamp_ns)

    def _draw_class(self, name: str, boxes: Table) -> None:
        self._log.add(
            f"{BOXES}/{name}",
            rr.Boxes3D(
                centers=columns(boxes, "x", "y", "z"),
                sizes=columns(boxes, "length", "width", "height"),
                quaternions=quaternion_from_rpy(columns(boxes, "roll", "pitch", "yaw").astype(np.float64)),
                labels=box_labels(name, boxes),
                show_labels=False,
                colors=class_color(name),
                radii=THIN_LINE,
            ),
        )

    def _draw_futures(self, boxes: Table, stamp_ns: int) -> None:
        assert self._tracks is not None
        tick_s = self._tracks.tick_ns * S_PER_NS
        moving = boxes[boxes["id"] < LIGHT_IDS]
        moving = moving[np.isin(moving["id"], self._tracks.id)]
        step_s = max(1, round(_STEP_S / tick_s)) * tick_s
        known = futures(self._tracks, moving["id"], np.full(len(moving), stamp_ns), _HORIZON_S, step_s)
        paths, colors = [], []
        for box, positions_m, valid in zip(moving, known.position_m, known.valid, strict=True):
            path_m = np.concatenate([[[box["x"], box["y"], box["z"]]], positions_m[valid]])
            if np.linalg.norm(path_m[-1] - path_m[0]) >= _MIN_MOVE_M:
                paths.append(path_m)
                colors.append(class_color(BOX_CLASSES[box["class"]]))
        self._log.add(f"{WORLD}/futures", rr.LineStrips3D(paths, colors=colors, radii=THIN_LINE))


class PredictionDrawing:
    """Draws the boxes that a perception stack predicts."""

    def __init__(self, log: SceneLog, subject: Subject) -> None:
        self._log, self._subject = log, subject

    def draw(self, samples: Samples) -> None:
        """Log the boxes of an answer.

        Raises:
            InputError: The message holds no valid boxes.
        """
        if "prediction/boxes" not in samples or "odom" not in samples:
            return
        message = samples.messages("prediction/boxes")[-1]
        type_name = getattr(message, "__msgtype__", "")
        if type_name not in BOX_TYPES:
            return
        answer = message_boxes(type_name, message, samples.tick, "/prediction/boxes")
        predictions = boxes_in_map(answer, ReferenceFrames(self._poses(samples)))
        boxes = predictions.boxes
        names = [BOX_CLASSES[label] for label in boxes.label.tolist()]
        self._log.add(
            PREDICTED_BOXES,
            rr.Boxes3D(
                centers=boxes.center_m,
                sizes=boxes.size_m,
                quaternions=quaternion_from_rpy(boxes.yaw_rad[:, None] * [0.0, 0.0, 1.0]),
                labels=[f"{name} {score:.2f}" for name, score in zip(names, predictions.score.tolist(), strict=True)],
                show_labels=False,
                colors=_PREDICTED_COLOR,
                radii=THIN_LINE,
            ),
        )

    def _poses(self, samples: Samples) -> Iterator[AgentPoses]:
        """Agents with poses among the samples; an answer may be in the frames of any."""
        shown = self._subject.view.agent
        for view in agent_views(self._subject.view.scene):
            key = "odom" if view.agent == shown else f"{view.agent}/odom"
            if key in samples:
                yield AgentPoses(view, calibrations(view.rig), _constant(poses_from_odometry(samples[key][-1])))


def box_labels(name: str, boxes: Table) -> list[str]:
    """Class, id, speed and visibility of (N,) boxes of one class."""
    speed_mps = np.linalg.norm(columns(boxes, "vx", "vy", "vz"), axis=1)
    rows = zip(boxes["id"].tolist(), speed_mps.tolist(), boxes["visibility"].tolist(), strict=True)
    return [
        f"{name} {number} · {speed:.1f} m/s · " + ("in no image" if share != share else f"{share:.0%} visible")
        for number, speed, share in rows
    ]


def _constant(pose: Float64Array) -> Callable[[int], Float64Array]:
    """The (4, 4) pose at whichever tick."""
    return lambda _: pose
