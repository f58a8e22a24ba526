"""Finds the cameras and the lidar of a scene of which a layout needs data. A scene enters; names and keys leave."""

from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.dataset import Scene


def recorded_cameras(scene: Scene) -> list[str]:
    """Names of an agent's cameras with RGB images."""
    return [
        name
        for name, known in scene.calibration.items()
        if "@" not in name and isinstance(known.sensor, Camera) and f"{name}/rgb" in scene.sources
    ]


def recorded_lidar(scene: Scene) -> tuple[str, str] | None:
    """Name of the first lidar with a recorded cloud, and the cloud's key; None: there is none."""
    for name, known in scene.calibration.items():
        if "@" not in name and isinstance(known.sensor, Lidar):
            for key in (f"{name}/points", f"{name}/semantic_points"):
                if key in scene.sources:
                    return name, key
    return None
