"""Makes the files of one agent at one frame in OPV2V's layout: a cloud, images, and YAML with poses and vehicles.

A frame enters, as an agent sees it; the bytes of files leave. The layout is documented in OpenCOOD's tutorials
"Data Introduction" and "Data Annotation Introduction" (https://opencood.readthedocs.io), whose example shows that
``extrinsic`` is camera from lidar although it is described as camera to lidar, and that both have CARLA's axes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml

from simbev_exporters.opv2v.carla_frame import carla_angles_deg, carla_pose, mirrored, mirrored_transform
from simbev_exporters.opv2v.connected_agents import ConnectedAgent
from simbev_exporters.opv2v.pcd import pcd_file
from simbev_ros.dataset import Frame, columns
from simbev_ros.dataset.frame_period import frame_period
from simbev_ros.dataset.values import poses_from_odometry
from simbev_ros.export.sensor_data import points_at_stamp, rectify
from simbev_ros.foundation.geometry.transforms import inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import BOX_CLASSES, MOTOR_CLASSES
from simbev_ros.foundation.types import AnyArray, Float64Array, Table
from simbev_ros.recording.png import RowFilter, encode_png
from simbev_ros.recording.qos import FAST_DUMPER
from simbev_ros.schema.v2x import OWN_POSE, V2X_DTYPE

PLAN_S = 3.0
"""Time that the agent's path ahead covers."""

_KMH_PER_MPS = 3.6
_DECIMALS = 9

Record = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameSettings:
    """Settings of the export that files of frames depend on.

    Attributes:
        rate_hz: Number of exported frames per second.
        classes: Classes of boxes that are vehicles of the layout.
        min_points: Minimum number of the agent's lidar points in a vehicle.
        cameras: Names of the cameras 0 to 3; None: chosen by their directions.
    """

    rate_hz: float = 10.0
    classes: tuple[str, ...] = MOTOR_CLASSES
    min_points: int = 1
    cameras: tuple[str, ...] | None = None


def frame_files(frame: Frame, agent: ConnectedAgent, settings: FrameSettings, motion: Table) -> dict[str, bytes]:
    """Files of an agent at a frame, by the end of their names behind the frame's number.

    Args:
        frame: The frame, as the agent sees it.
        agent: The agent.
        settings: Settings of the export.
        motion: (K,) ``ODOMETRY_DTYPE`` motion of the agent over the scene, in order of time.
    """
    record = {
        **_poses(frame, agent),
        "plan_trajectory": _plan(frame, motion, settings.rate_hz),
        **{f"camera{number}": _camera(frame, agent, name) for number, name in agent.cameras.items()},
        "vehicles": _vehicles(frame, settings),
    }
    images = {f"_camera{number}.png": _image(frame, name) for number, name in agent.cameras.items()}
    return {".yaml": yaml_file(record), ".pcd": _cloud(frame, agent), **images}


def yaml_file(record: Record) -> bytes:
    """YAML file of plain values; lists of numbers are on one line."""
    return str(yaml.dump(record, Dumper=FAST_DUMPER, sort_keys=False, default_flow_style=None)).encode()


def motion_of(agent: ConnectedAgent) -> Table:
    """(K,) ``ODOMETRY_DTYPE`` motion of an agent over its scene.

    Raises:
        BagError: The bag is damaged.
    """
    source = agent.scene.sources["odom"]
    motion: Table = source.value(source.topic.locations)
    return motion


def _poses(frame: Frame, agent: ConnectedAgent) -> Record:
    """Poses and speed of the agent."""
    return {
        "RSU": frame.scene.view.station is not None,
        "lidar_pose": _plain(carla_pose(frame.map_from_sensor(agent.lidar))),
        "true_ego_pos": _plain(carla_pose(frame.map_from_ego)),
        "predicted_ego_pos": _plain(carla_pose(_sent_pose(frame))),
        "ego_speed": _speed_kmh(frame["odom"][-1]["velocity_mps"]),
    }


def _sent_pose(frame: Frame) -> Float64Array:
    """(4, 4) pose, map from ego, that the agent sends at the frame; the true one if it sends nothing."""
    key = f"v2x/{frame.scene.agent}"
    sent: Table = frame[key] if key in frame else np.zeros(0, V2X_DTYPE)
    own = sent[sent["id"] == OWN_POSE]
    if not len(own):
        return frame.map_from_ego
    return matrices_from_xyz_rpy(columns(own, "x", "y", "z")[0], columns(own, "roll", "pitch", "yaw")[0])


def _plan(frame: Frame, motion: Table, rate_hz: float) -> list[list[float]]:
    """X, y and speed in km/h where the agent drives next, at each exported frame; a roadside unit has no path."""
    if frame.scene.view.station is not None:
        return []
    step_ns = frame_period(frame.scene, rate_hz, "rate_hz") * frame.scene.tick_ns
    stamps_ns = frame.stamp_ns + step_ns * np.arange(1, round(PLAN_S * rate_hz) + 1)
    rows = motion[np.isin(motion["stamp_ns"], stamps_ns)]
    places = mirrored(poses_from_odometry(rows)[:, :3, 3])
    speeds_kmh = np.linalg.norm(rows["velocity_mps"], axis=1) * _KMH_PER_MPS
    return _plain(np.column_stack([places[:, :2], speeds_kmh]))


def _camera(frame: Frame, agent: ConnectedAgent, name: str) -> Record:
    map_from_camera, map_from_lidar = frame.map_from_sensor(name), frame.map_from_sensor(agent.lidar)
    return {
        "cords": _plain(carla_pose(map_from_camera)),
        "extrinsic": _plain(mirrored_transform(inverse(map_from_camera) @ map_from_lidar)),
        "intrinsic": _plain(frame.scene.calibration[name].intrinsics),
    }


def _vehicles(frame: Frame, settings: FrameSettings) -> dict[int, Record]:
    """The vehicles around the agent by id, other agents among them.

    Readers add ``center`` to ``location`` without turning it, so ``location`` is straight below the box's center.
    """
    boxes = frame["boxes"]
    wanted = np.isin(boxes["class"], [BOX_CLASSES.index(name) for name in settings.classes])
    boxes = boxes[wanted & (np.maximum(boxes["lidar_points"], 0) >= settings.min_points)]
    blueprints = frame.scene.constants["world/legend"]["blueprints"]
    half_m = columns(boxes, "length", "width", "height").astype(np.float64) / 2.0
    up_m = half_m * [0.0, 0.0, 1.0]
    values = {
        "location": mirrored(columns(boxes, "x", "y", "z") - up_m),
        "center": up_m,
        "angle": carla_angles_deg(columns(boxes, "roll", "pitch", "yaw")),
        "extent": half_m,
    }
    rows = zip(boxes, *(_plain(each) for each in values.values()), strict=True)
    return {
        int(box["id"]): {**dict(zip(values, vectors, strict=True)), **_identity(box, blueprints)}
        for box, *vectors in rows
    }


def _identity(box: Table, blueprints: Sequence[Mapping[str, Any]]) -> Record:
    color = int(box["color"])
    return {
        "speed": _speed_kmh(np.array([box["vx"], box["vy"], box["vz"]], np.float64)),
        "bp_id": blueprints[int(box["blueprint"])]["name"],
        "color": f"{color >> 16}, {color >> 8 & 255}, {color & 255}",
        "class": BOX_CLASSES[box["class"]],
    }


def _cloud(frame: Frame, agent: ConnectedAgent) -> bytes:
    """PCD file of the lidar's cloud; without intensities the cosine of the incidence angle replaces them."""
    cloud: Table = frame[agent.cloud]
    points_m = points_at_stamp(frame, agent.cloud, frame.scene.calibration[agent.lidar])
    name = "intensity" if "intensity" in (cloud.dtype.names or ()) else "cos_angle"
    return pcd_file(mirrored(points_m.astype(np.float64)), cloud[name])


def _image(frame: Frame, name: str) -> bytes:
    """PNG file of a camera's image, rectified if the lens distorts it."""
    return encode_png(rectify(frame[f"{name}/rgb"], frame.scene.calibration[name].camera), RowFilter.UP)


def _speed_kmh(velocity_mps: AnyArray) -> float:
    return round(float(np.linalg.norm(velocity_mps)) * _KMH_PER_MPS, _DECIMALS)


def _plain(values: AnyArray) -> Any:
    """Rounded values as lists of floats, without negative zeros."""
    return (np.round(np.asarray(values, np.float64), _DECIMALS) + 0.0).tolist()
