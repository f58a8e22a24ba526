"""Points of recorded frames are in the level frame of their newest sweep, as those of a cache are."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_scene import MadeUp, made_up_scene
from scipy.spatial.transform import Rotation

from simbev_ros.baselines.dataset_points import points_at
from simbev_ros.dataset import Scene, open_dataset
from simbev_ros.foundation.errors import InputError

LIDAR: dict[str, Any] = {"type": "lidar", "name": "top", "pose": {"x_m": 0.5, "z_m": 1.8, "yaw_deg": 30}}
TICKS = 7


def recorded(folder: Path, sensors: list[dict[str, Any]]) -> tuple[MadeUp, Scene]:
    made = made_up_scene(folder / "Blocks-0000", ticks=TICKS, sensors=sensors)
    return made, open_dataset(folder / "Blocks-0000").scenes[0]


def test_points_of_all_sweeps_are_in_the_level_frame_of_the_newest(tmp_path: Path) -> None:
    made, scene = recorded(tmp_path, [LIDAR])
    points = points_at(scene, TICKS - 1, (0, 250_000_000, 2_000_000_000))
    (x, y, z), (_, _, heading_rad) = made.ticks[-1]["odom"]
    assert set(points[:, 3]) == {0.0, 1.0}  # there is no sweep of 2 s before
    for sweep, tick in enumerate((TICKS - 1, TICKS - 6)):
        cloud = made.ticks[tick]["top/points"]
        turned = Rotation.from_euler("z", np.radians(30)).apply(np.stack([cloud[a] for a in "xyz"], 1))
        position, rpy_rad = made.ticks[tick]["odom"]
        in_map = Rotation.from_euler("xyz", rpy_rad).apply(turned + np.array([0.5, 0, 1.8])) + position
        wanted = Rotation.from_euler("z", -heading_rad).apply(in_map - [x, y, z])
        assert points[points[:, 3] == sweep, :3] == pytest.approx(wanted, abs=2e-4)


def test_an_agent_without_lidar_is_refused(tmp_path: Path) -> None:
    _, scene = recorded(tmp_path, [{"type": "gnss", "name": "gnss"}])
    with pytest.raises(InputError, match="has no lidar with points"):
        points_at(scene, 0, (0,))
