"""Labels in vision_msgs: 3D and 2D detections, and the names of classes in label images."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from simbev_ros.drawing.displays.messages import MAP_FRAME, build, pose, serialize, stamped, vector
from simbev_ros.foundation.geometry.transforms import quaternion_from_rpy
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Table

DETECTIONS_3D = "vision_msgs/msg/Detection3DArray"
DETECTIONS_2D = "vision_msgs/msg/Detection2DArray"
LABEL_INFO = "vision_msgs/msg/LabelInfo"

_CERTAIN = 1.0
"""Score of what is true."""


def detections_3d(boxes: Table, stamp_ns: int) -> bytes:
    """Detection3DArray with the 3D boxes around the ego, in the map frame.

    A detection has the id of its box, and one hypothesis: the name of its class with score 1.

    Args:
        boxes: (N,) ``BOX_DTYPE``.
        stamp_ns: Stamp.
    """
    header = stamped(stamp_ns, MAP_FRAME)
    centers_m, rpy_rad, sizes_m = (
        np.stack([boxes[name] for name in names.split()], axis=-1).astype(np.float64)
        for names in ("x y z", "roll pitch yaw", "length width height")
    )
    orientations = quaternion_from_rpy(rpy_rad).tolist()
    detections = []
    for center, xyzw, size, number, identity in zip(
        centers_m.tolist(), orientations, sizes_m.tolist(), boxes["class"].tolist(), boxes["id"].tolist(), strict=True
    ):
        where = pose(center, xyzw)
        detections.append(
            build(
                "vision_msgs/msg/Detection3D",
                header=header,
                results=[_hypothesis(BOX_CLASSES[number], pose=build(_POSE, pose=where))],
                bbox=build("vision_msgs/msg/BoundingBox3D", center=where, size=vector(*size)),
                id=str(identity),
            )
        )
    return serialize(build(DETECTIONS_3D, header=header, detections=detections))


def detections_2d(views: Table, stamp_ns: int, frame: str, prefix: str = "") -> bytes:
    """Detection2DArray with the boxes of what a camera sees.

    Pixel centers are at integers, as in ``VIEW_DTYPE``.

    Args:
        views: (K,) ``VIEW_DTYPE``.
        stamp_ns: Stamp of the image.
        frame: The camera's optical frame.
        prefix: Empty: boxes around visible pixels, of objects that have some; ``amodal_``: boxes around the whole
            silhouettes of all objects.
    """
    header = stamped(stamp_ns, frame)
    shown = views if prefix else views[views["visible_px"] > 0]
    left, top, right, bottom = (shown[f"{prefix}{side}"].astype(np.float64) for side in _SIDES)
    center_px, size_px = (
        np.stack([left + right, top + bottom], axis=-1) / 2.0,
        np.stack([right - left, bottom - top], -1),
    )
    detections = []
    for (x, y), (width, height), number, identity in zip(
        center_px.tolist(), size_px.tolist(), shown["class"].tolist(), shown["id"].tolist(), strict=True
    ):
        center = build("vision_msgs/msg/Pose2D", position=build("vision_msgs/msg/Point2D", x=x, y=y))
        detections.append(
            build(
                "vision_msgs/msg/Detection2D",
                header=header,
                results=[_hypothesis(BOX_CLASSES[number])],
                bbox=build("vision_msgs/msg/BoundingBox2D", center=center, size_x=width, size_y=height),
                id=str(identity),
            )
        )
    return serialize(build(DETECTIONS_2D, header=header, detections=detections))


def label_info(names: Mapping[int, str], stamp_ns: int, frame: str) -> bytes:
    """LabelInfo with the names of the classes in a label image.

    Args:
        names: Name of each class by its number in the image.
        stamp_ns: Stamp.
        frame: Frame of the image.
    """
    classes = [build("vision_msgs/msg/VisionClass", class_id=number, class_name=name) for number, name in names.items()]
    return serialize(build(LABEL_INFO, header=stamped(stamp_ns, frame), class_map=classes, threshold=_CERTAIN))


_POSE = "geometry_msgs/msg/PoseWithCovariance"
_SIDES = ("left", "top", "right", "bottom")


def _hypothesis(name: str, **pose_of: Any) -> Any:
    """The one hypothesis of a detection."""
    hypothesis = build("vision_msgs/msg/ObjectHypothesis", class_id=name, score=_CERTAIN)
    return build("vision_msgs/msg/ObjectHypothesisWithPose", hypothesis=hypothesis, **pose_of)
