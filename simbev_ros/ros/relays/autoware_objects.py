"""Converts the true boxes around the ego to Autoware's tracked and predicted objects. Pure."""

import numpy as np
from autoware_perception_msgs.msg import (
    ObjectClassification,
    PredictedObject,
    PredictedObjects,
    PredictedPath,
    TrackedObject,
    TrackedObjects,
)
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Pose
from unique_identifier_msgs.msg import UUID

from simbev_ros.foundation.geometry.transforms import quaternion_from_rpy, rotations_from_rpy
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.ros.msgs.stamps import header
from simbev_ros.ros.msgs.world import MAP_FRAME, point_message, quaternion_message, vector_message
from simbev_ros.schema.scene.spec import scene_number_of

_STEP_NS, _STEPS = 500_000_000, 20
"""Those of Autoware's map_based_prediction: 10 s in steps of 0.5 s."""
_STATIONARY_MPS = 0.1
_LABELS = {
    "car": ObjectClassification.CAR,
    "truck": ObjectClassification.TRUCK,
    "bus": ObjectClassification.BUS,
    "motorcycle": ObjectClassification.MOTORCYCLE,
    "bicycle": ObjectClassification.BICYCLE,
    "pedestrian": ObjectClassification.PEDESTRIAN,
    "traffic_cone": ObjectClassification.UNKNOWN,
    "barrier": ObjectClassification.UNKNOWN,
}
"""Labels of our classes; Autoware does not count lights and signs as objects, and has no label for obstacles."""


def tracked_objects(boxes: Table, stamp_ns: int) -> TrackedObjects:
    """Tracked objects of (N,) ``BOX_DTYPE`` rows at one time, in the map frame, with covariances of zero.

    Velocities and accelerations are in the frame of the object.
    """
    message, rows = TrackedObjects(header=header(stamp_ns, MAP_FRAME)), _labeled(boxes)
    scene = max(scene_number_of(stamp_ns), 0)
    rpy_rad = np.stack([rows[name] for name in ("roll", "pitch", "yaw")], axis=1).astype(np.float64)
    own_from_map = rotations_from_rpy(rpy_rad).transpose(0, 2, 1)
    velocity, rates, acceleration = (np.einsum("nij,nj->ni", own_from_map, _xyz(rows, name)) for name in "vwa")
    positions_m, rotations = _xyz(rows, ""), quaternion_from_rpy(rpy_rad)
    for index, row in enumerate(rows):
        tracked = TrackedObject(object_id=UUID(uuid=object_uuid(scene, int(row["id"]))), existence_probability=1.0)
        label = _LABELS[BOX_CLASSES[int(row["class"])]]
        tracked.classification = [ObjectClassification(label=label, probability=1.0)]
        tracked.shape.dimensions = vector_message(np.array([row["length"], row["width"], row["height"]]))
        motion = tracked.kinematics
        motion.pose_with_covariance.pose.position = point_message(positions_m[index])
        motion.pose_with_covariance.pose.orientation = quaternion_message(rotations[index])
        twist = motion.twist_with_covariance.twist
        twist.linear, twist.angular = vector_message(velocity[index]), vector_message(rates[index])
        motion.acceleration_with_covariance.accel.linear = vector_message(acceleration[index])
        motion.orientation_availability = motion.AVAILABLE
        motion.is_stationary = bool(np.linalg.norm(velocity[index]) < _STATIONARY_MPS)
        message.objects.append(tracked)
    return message


def predicted_objects(boxes: Table, stamp_ns: int) -> PredictedObjects:
    """Predicted objects of (N,) ``BOX_DTYPE`` rows at one time, in the map frame: each keeps its velocity for 10 s."""
    message, rows = PredictedObjects(header=header(stamp_ns, MAP_FRAME)), _labeled(boxes)
    times_s = np.arange(_STEPS + 1) * (_STEP_NS / 1e9)
    paths_m = _xyz(rows, "")[:, None] + times_s[:, None] * _xyz(rows, "v")[:, None]
    for tracked, path_m in zip(tracked_objects(boxes, stamp_ns).objects, paths_m, strict=True):
        predicted, motion = PredictedObject(object_id=tracked.object_id, existence_probability=1.0), tracked.kinematics
        predicted.classification, predicted.shape = tracked.classification, tracked.shape
        for part in ("pose", "twist", "acceleration"):
            name = f"{part}_with_covariance"
            setattr(predicted.kinematics, f"initial_{name}", getattr(motion, name))
        facing = motion.pose_with_covariance.pose.orientation
        poses = [Pose(position=point_message(point_m), orientation=facing) for point_m in path_m]
        path = PredictedPath(path=poses, time_step=Duration(nanosec=_STEP_NS), confidence=1.0)
        predicted.kinematics.predicted_paths = [path]
        message.objects.append(predicted)
    return message


def _labeled(boxes: Table) -> Table:
    """The rows of classes that Autoware takes for objects."""
    return boxes[np.isin(boxes["class"], [BOX_CLASSES.index(name) for name in _LABELS])]


def _xyz(rows: Table, prefix: str) -> Float64Array:
    """(N, 3) columns such as vx, vy, vz."""
    return np.stack([rows[f"{prefix}{axis}"].astype(np.float64) for axis in "xyz"], axis=1)


def object_uuid(scene: int, actor: int) -> list[int]:
    """The 16 bytes of an object's UUID: number of the scene and id of the actor, big-endian."""
    return list((scene << 32 | actor).to_bytes(16, "big"))
