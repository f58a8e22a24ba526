"""Recorded frames of other agents as one of them receives them: where each was, how old it is, and the sender's box."""

from typing import NamedTuple

import numpy as np

from simbev_ros.dataset.frame import Frame
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.reference_stack.fusion import received_boxes
from simbev_ros.reference_stack.pipeline import BOX_DTYPE
from simbev_ros.schema.v2x import OWN_POSE, V2X_DTYPE, boxes_of_messages


class ReceivedFrame(NamedTuple):
    """A frame of another agent that has arrived.

    Attributes:
        frame: The frame.
        map_from_ego: (4, 4) pose of its agent as the receiver knows it.
        age_s: Time since then.
    """

    frame: Frame
    map_from_ego: Float64Array
    age_s: float

    def own_box(self) -> Table:
        """(0 or 1,) ``pipeline.BOX_DTYPE`` box of the sender where the receiver takes it to be, map frame.

        There is none of a roadside unit, or in a scene without messages.
        """
        rows = _own_row(self.frame)
        known = boxes_of_messages(rows)
        box = np.zeros(len(known), BOX_DTYPE)
        for name in set(BOX_DTYPE.names or ()) - {"score", "id"}:
            box[name] = known[name]
        box["score"], box["id"] = 1.0, -1
        return received_boxes(box, _pose(rows), self.map_from_ego, self.age_s) if len(box) else box


def frames_of_others(frame: Frame) -> list[ReceivedFrame]:
    """What the other agents see at the same instant, without errors."""
    return [ReceivedFrame(each, each.map_from_ego, 0.0) for each in frame.others.values()]


def arrived_frames(frame: Frame) -> list[ReceivedFrame]:
    """What the others saw when they sent the newest messages that have arrived, with the poses that they have sent."""
    frames = frame.received.values()
    return [ReceivedFrame(each, _pose(_own_row(each)), (frame.stamp_ns - each.stamp_ns) / NS_PER_S) for each in frames]


def _own_row(frame: Frame) -> Table:
    """(0 or 1,) row of what a frame's agent sends with its own pose."""
    message: Table | None = frame.get(f"v2x/{frame.scene.agent}")
    return np.zeros(0, V2X_DTYPE) if message is None else message[message["id"] == OWN_POSE][:1]


def _pose(rows: Table) -> Float64Array:
    """(4, 4) pose in the first row of a message."""
    xyz, rpy = (np.array([rows[0][axis] for axis in axes], np.float64) for axes in ("xyz", ("roll", "pitch", "yaw")))
    return matrices_from_xyz_rpy(xyz, rpy)
