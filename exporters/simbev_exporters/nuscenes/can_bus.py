"""Exports what a scene has of nuScenes' CAN bus expansion: the ego's motion, IMU, speed and lights, with statistics.

A scene and the origin of nuScenes' coordinates enter; ``can_bus/<scene>_<message>.json`` leaves. Messages come at each
tick, ``ms_imu`` at the rate of the IMU. nuScenes' other messages and fields are of devices that are not simulated: the
steering wheel, pedals, motor and battery; the ego follows no route that is known beforehand. A roadside unit has no
``vehicle_monitor``.
"""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from glob import escape
from typing import Any

import numpy as np

from simbev_exporters.nuscenes.annotations import make_continuous
from simbev_exporters.nuscenes.channel_records import wxyz
from simbev_exporters.nuscenes.scene_names import numbered
from simbev_exporters.nuscenes.scene_part import ScenePart
from simbev_exporters.nuscenes.sites import Site
from simbev_exporters.nuscenes.taxonomy import Record
from simbev_exporters.scene_parts import PartOfScene, source_of
from simbev_ros.config.positioning import Imu
from simbev_ros.dataset import Frame, Scene
from simbev_ros.export.parts import PARTS_FOLDER, Json
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_quaternion
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.foundation.units import GRAVITY_MPS2, NS_PER_S
from simbev_ros.schema.scene.state import Light

FOLDER = "can_bus"
"""Folder of the messages."""

_NS_PER_US = 1000
_KMH_PER_MPS = 3.6
_DECIMALS = 9
_KEYS = ("odom", "world/actors")
_RELEASED, _PRESSED = 1, 2  # the brake switch's values
_STATISTICS: dict[str, Callable[..., Any]] = {"max": np.max, "mean": np.mean, "min": np.min, "std": np.std}


@dataclass(frozen=True, slots=True, kw_only=True)
class CanBusPart(PartOfScene):
    """The CAN bus messages of a scene as one part of the export.

    Attributes:
        published_name: Name of the scene in the tables.
        origin_m: Origin of nuScenes' global frame, map frame.
    """

    published_name: str
    origin_m: tuple[float, float]


def can_bus_parts(parts: Sequence[ScenePart], sites: Sequence[Site], names: Mapping[str, str]) -> list[CanBusPart]:
    """The parts with the messages of scenes, finished or not; ``names`` are the published names of scenes."""
    site_of = {name: site for site in sites for name in site.scenes}
    return [
        CanBusPart(
            out=part.out,
            name=f"{part.name}.can_bus",
            identity=_identity(part.scene, names[part.name], site_of[part.name].low_m),
            patterns=tuple(f"{FOLDER}/{escape(name)}_*.json" for name in _names_of(part, names)),
            scene=part.scene,
            published_name=names[part.name],
            origin_m=site_of[part.name].low_m,
        )
        for part in parts
    ]


def _identity(scene: Scene, name: str, origin_m: tuple[float, float]) -> Json:
    return {"made_from": source_of(scene), "name": name, "origin_m": list(origin_m)}


def _names_of(part: ScenePart, names: Mapping[str, str]) -> set[str]:
    """Names with which files of a scene can be there: its present one, its own, and the former one if it is free."""
    try:
        former = str(parse_json((part.out / PARTS_FOLDER / f"{part.name}.can_bus.json").read_bytes())["name"])
    except (OSError, ValueError, LookupError, TypeError):
        former = part.name
    others = {name for scene, name in names.items() if scene != part.name}
    return {part.name, names[part.name], numbered(part.scene.number), former} - others


def make_can_bus_part(part: CanBusPart) -> None:
    """Write the messages of one scene.

    Raises:
        InputError: A file cannot be written.
        BagError: The bag is damaged.
    """
    part.begin()
    messages = {name: rows for name, rows in can_bus_messages(part.scene, part.origin_m).items() if rows}
    files: dict[str, Any] = {**messages, "meta": {name: _statistics(rows) for name, rows in messages.items()}}
    for name, content in files.items():
        part.write(f"{FOLDER}/{part.published_name}_{name}.json", json.dumps(content).encode())
    part.finish({})


def can_bus_messages(scene: Scene, origin_m: tuple[float, float]) -> dict[str, list[Record]]:
    """Messages by name, in order of time; a message of which nothing was recorded has an empty list.

    Args:
        scene: The scene.
        origin_m: Origin of nuScenes' global frame, map frame.
    """
    imu, messages = imu_of(scene), {name: list[Record]() for name in ("pose", "ms_imu", "vehicle_monitor")}
    for tick in np.flatnonzero(scene.has(_KEYS)).tolist():
        frame = scene[tick]
        odometry, ego = frame["odom"][-1], scene.view.ego_row(frame["world/actors"])
        messages["pose"].append(_pose(odometry, ego, origin_m))
        if scene.view.station is None:
            messages["vehicle_monitor"].append(_vehicle_monitor(odometry, ego))
        messages["ms_imu"] += _imu_messages(frame, imu)
    make_continuous(messages["pose"], "orientation")
    make_continuous(messages["ms_imu"], "q")
    return messages


def imu_of(scene: Scene) -> str | None:
    """Key of the IMU that is exported, the first of the rig that was recorded; None: there is none."""
    sensors = (calibration.sensor for calibration in scene.calibration.values())
    keys = (f"{sensor.name}/data" for sensor in sensors if isinstance(sensor, Imu))
    return next((key for key in keys if key in scene.sources), None)


def _pose(odometry: Table, ego: Table, origin_m: tuple[float, float]) -> Record:
    """Pose and motion of the ego; the acceleration is the specific force, +g upward at rest, as in nuScenes."""
    ego_from_map = matrices_from_xyz_quaternion(np.zeros(3), odometry["orientation_xyzw"])[:3, :3].T
    acceleration_mps2 = np.array([ego["ax"], ego["ay"], ego["az"] + GRAVITY_MPS2], np.float64)
    return {
        "utime": _utime(odometry),
        "accel": _plain(ego_from_map @ acceleration_mps2),
        "orientation": _plain(wxyz(odometry["orientation_xyzw"])),
        "pos": _plain(odometry["position_m"] - [*origin_m, 0.0]),
        "rotation_rate": _plain(odometry["angular_velocity_radps"]),
        "vel": _plain(odometry["velocity_mps"]),
    }


def _vehicle_monitor(odometry: Table, ego: Table) -> Record:
    """Speed in km/h, yaw rate in degrees/s, and lights; signals are 1 while their lamps are lit."""
    lights = int(ego["lights"])
    return {
        "utime": _utime(odometry),
        "brake_switch": _PRESSED if lights & Light.BRAKE else _RELEASED,
        "left_signal": int(bool(lights & Light.TURN_LEFT)),
        "right_signal": int(bool(lights & Light.TURN_RIGHT)),
        "vehicle_speed": round(float(odometry["velocity_mps"][0]) * _KMH_PER_MPS, 2),
        "yaw_rate": round(float(np.degrees(odometry["angular_velocity_radps"][2])), 1),
    }


def _imu_messages(frame: Frame, key: str | None) -> Iterator[Record]:
    rows: Iterable[Table] = frame[key] if key is not None and key in frame else ()
    for row in rows:
        yield {
            "utime": _utime(row),
            "linear_accel": _plain(row["acceleration_mps2"]),
            "q": _plain(wxyz(row["orientation_xyzw"])),
            "rotation_rate": _plain(row["angular_velocity_radps"]),
        }


def _statistics(messages: Sequence[Record]) -> Json:
    """Statistics of one kind of messages, of their values and of the differences between consecutive ones."""
    timespan_s = (messages[-1]["utime"] - messages[0]["utime"]) * _NS_PER_US / NS_PER_S
    variables = {name: np.array([each[name] for each in messages], np.float64) for name in messages[0]}
    return {
        "message_count": len(messages),
        "message_freq": round((len(messages) - 1) / timespan_s, 6) if timespan_s else 0.0,
        "timespan": timespan_s,
        "var_stats": {
            name: {**_figures(values, ""), **_figures(np.diff(values, axis=0), "diff_")}
            for name, values in variables.items()
        },
    }


def _figures(values: Float64Array, prefix: str) -> dict[str, Any]:
    return {f"{prefix}{name}": of(values, axis=0).tolist() for name, of in _STATISTICS.items() if len(values)}


def _utime(row: Table) -> int:
    return int(row["stamp_ns"]) // _NS_PER_US


def _plain(values: Float64Array) -> list[float]:
    plain: list[float] = (np.round(values, _DECIMALS) + 0.0).tolist()
    return plain
