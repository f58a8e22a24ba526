"""Clouds of rolling scans in an export to nuScenes."""

from types import SimpleNamespace
from typing import Any

import numpy as np
from made_up_scene import made_up_spec

from simbev_exporters.nuscenes import sensor_files
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.sensor import Pose
from simbev_ros.dataset.calibration import Calibration
from simbev_ros.dataset.nuscenes.channels import Channel
from simbev_ros.schema.points import POINT_DTYPE
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.schema.scene.state import ACTOR_DTYPE, EGO_ID


class _Moving(dict[str, Any]):
    """A frame whose ego is at the map's origin and drives along x."""

    map_from_ego = np.eye(4)
    scene = SimpleNamespace(view=agent_view(made_up_spec([])))


def test_points_of_a_rolling_scan_are_moved_to_the_stamp() -> None:
    lidar = Calibration.from_sensor(Lidar(type="lidar", name="lidar", pose=Pose(z_m=1.8, yaw_deg=90), rolling=True))
    ego = np.zeros(1, ACTOR_DTYPE)
    ego["id"], ego["vx"] = EGO_ID, 10.0
    cloud = np.zeros(2, POINT_DTYPE)
    cloud["y"], cloud["time"] = [-20.0, -20.5], [0.0, -0.05]  # one position ahead, seen now and half a meter earlier
    frame = _Moving({"lidar/points": cloud, "world/actors": ego})
    data = sensor_files.encode_file(frame, Channel("LIDAR_TOP", "lidar", "lidar/points", lidar))  # type: ignore[arg-type]
    rows = np.frombuffer(data, np.float32).reshape(-1, 5)
    np.testing.assert_allclose(rows[:, :3], [[20, 0, 0]] * 2, atol=1e-5)  # to the right of a lidar that looks left
