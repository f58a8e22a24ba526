"""Content of the SimBEV layout's info files: sensor poses, and the settings and frames of each scene.

Scenes and frames enter; plain values for JSON leave.
"""

from typing import Any

import numpy as np

from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.radar import Radar
from simbev_ros.dataset import Frame, Scene
from simbev_ros.export.quaternions import positive
from simbev_ros.export.simbev.channels import CAMERAS, RADARS, lidar_of
from simbev_ros.foundation.geometry.transforms import inverse, quaternion_from_rpy, rpy_from_rotation
from simbev_ros.foundation.types import Float64Array

_NS_PER_US = 1000
_COUNTED = ("vehicles", "pedestrians")
"""Lists of a scene of which only the length is given; what they contain is in the boxes."""


def metadata(scene: Scene) -> dict[str, Any]:
    """Metadata of an info file: poses of the sensors, camera intrinsics and the extent of the voxel grid."""
    lidar = lidar_of(scene)
    ego_from_lidar = np.eye(4) if lidar is None else scene.calibration[lidar.name].ego_from_sensor
    poses = _poses(scene)
    result: dict[str, Any] = {name: _pose(ego_from_sensor, ego_from_lidar) for name, ego_from_sensor in poses.items()}
    for calibration in scene.calibration.values():
        if isinstance(calibration.sensor, Camera):
            result["camera_intrinsics"] = calibration.intrinsics.tolist()
            break
    occupancy = scene.view.annotation.occupancy
    if occupancy is not None:
        result["voxel_detector_properties"] = {
            "range": occupancy.half_side_m,
            "voxel_size": occupancy.voxel_m,
            "upper_limit": occupancy.top_m,
            "lower_limit": occupancy.bottom_m,
        }
    return result


def scene_info(scene: Scene) -> dict[str, Any]:
    """The entry of a scene: its map's name, numbers of actors, and all settings of the scene and of the agent."""
    spec, agent = scene.spec, scene.view.spec.model_dump(mode="json")
    settings = spec.model_dump(mode="json", exclude={*_COUNTED, "map", "agents"})
    counts = {name: len(getattr(spec, name)) for name in _COUNTED}
    roads = spec.map.model_dump(mode="json", exclude={"path"})
    return {"map": spec.map.name, **counts, "map_settings": roads, **settings, **agent}


def frame_info(frame: Frame) -> dict[str, Any]:
    """The entry of a frame: pose of the ego and time in µs; the paths of its files are added later."""
    map_from_ego = frame.map_from_ego
    return {
        "ego2global_translation": map_from_ego[:3, 3].tolist(),
        "ego2global_rotation": _wxyz(map_from_ego),
        "timestamp": frame.stamp_ns // _NS_PER_US,
        "scene": frame.scene.number,
        "frame": frame.tick,
    }


def _poses(scene: Scene) -> dict[str, Float64Array]:
    """(4, 4) ego_from_sensor by the layout's names of sensors; those of cameras are of the optical frame."""
    known, poses = scene.calibration, {}
    lidar = lidar_of(scene)
    if lidar is not None:
        poses["LIDAR"] = known[lidar.name].ego_from_sensor
    for name in (name for name in CAMERAS if _is_a(scene, f"cam_{name}", Camera)):
        poses[f"CAM_{name.upper()}"] = known[f"cam_{name}"].ego_from_optical
    for name in (name for name in RADARS if _is_a(scene, f"radar_{name}", Radar)):
        poses[f"RAD_{name.upper()}"] = known[f"radar_{name}"].ego_from_sensor
    if scene.view.annotation.occupancy is not None:
        poses["VOXEL-GRID"] = np.eye(4)
    return poses


def _is_a(scene: Scene, name: str, kind: type[Camera | Lidar | Radar]) -> bool:
    return name in scene.calibration and isinstance(scene.calibration[name].sensor, kind)


def _pose(ego_from_sensor: Float64Array, ego_from_lidar: Float64Array) -> dict[str, Any]:
    lidar_from_sensor = inverse(ego_from_lidar) @ ego_from_sensor
    return {
        "sensor2lidar_translation": lidar_from_sensor[:3, 3].tolist(),
        "sensor2lidar_rotation": _wxyz(lidar_from_sensor),
        "sensor2ego_translation": ego_from_sensor[:3, 3].tolist(),
        "sensor2ego_rotation": _wxyz(ego_from_sensor),
    }


def _wxyz(transform: Float64Array) -> list[float]:
    """The rotation of a (4, 4) transform as a unit quaternion w, x, y, z with w >= 0."""
    xyzw = quaternion_from_rpy(rpy_from_rotation(transform[:3, :3]))
    quaternion: list[float] = positive(np.roll(xyzw, 1)).tolist()
    return quaternion
