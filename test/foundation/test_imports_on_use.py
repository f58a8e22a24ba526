"""Modules that take long to load are only imported by the processes that need them."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    ("module", "unused"),
    [
        ("simbev_ros.cli.main", {"numpy", "rclpy", "pydantic", "simbev_ros.cli.run"}),
        ("simbev_ros.dataset.plan", {"pyarrow", "rosbags", "simbev_ros.dataset.frame"}),
        ("simbev_ros.recording.reader", {"pyarrow"}),
        ("simbev_ros.production.play", {"pyarrow", "simbev_ros.dataset.frame", "simbev_ros.evaluation"}),
        (
            "simbev_ros.production.dataset",
            {"scipy", "pyproj", "simbev_ros.production.scene_maker", "simbev_ros.simulation.world"},
        ),
        ("simbev_ros.ros.nodes.lidar_node", {"moderngl", "libsumo", "scipy.interpolate", "simbev_ros.maps.builder"}),
        (
            "simbev_ros.ros.nodes.camera_node",
            {"open3d", "libsumo", "scipy.interpolate", "simbev_ros.assets.regions.build"},
        ),
        ("simbev_ros.ros.nodes.world_node", {"moderngl", "open3d", "simbev_ros.maps.builder"}),
    ],
)
def test_importing_a_module_does_not_load_what_it_may_never_need(module: str, unused: set[str]) -> None:
    program = f"import sys, {module}; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout.split()
    assert module in loaded and unused & set(loaded) == set()
