"""Fixtures shared by tests: exports of datasets, and Pythons of environments with the devkits of others."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from made_up_scene import made_up_scene
from nuscenes_tables import export
from processes import run

from simbev_exporters.nuscenes import map_masks
from simbev_exporters.nuscenes.map_expansion import expansion
from simbev_exporters.nuscenes.sites import Site
from simbev_ros.foundation.cache.entries import default_cache_dir
from simbev_ros.maps.network import RoadNetwork
from tools.bench.devkit_comparison import DEVKIT, devkit_environment

CAMERA = """{type: camera, name: NAME, pose: {x_m: X, z_m: 1.6, yaw_deg: YAW},
       width_px: 320, height_px: 180, modalities: [rgb, instance]}"""
CONFIG = f"""
seed: 3
scenes: [{{map: Blocks, train: 2}}]
time: {{warm_up_s: 2, duration_s: 2}}
rig:
  sensors:
    - {CAMERA.replace("NAME", "cam_front").replace("X", "0.6").replace("YAW", "0")}
    - {CAMERA.replace("NAME", "cam_back").replace("X", "-1.0").replace("YAW", "180")}
    - {{type: lidar, name: lidar, pose: {{z_m: 1.8, yaw_deg: 10}}, channels: 32, columns: 512}}
    - {{type: radar, name: radar_front, pose: {{x_m: 2.4, z_m: 0.6}}, points_per_second: 20000}}
weather: {{cloudiness: 20, precipitation: 0, sun_altitude_deg: 45, fog_density: 0}}
traffic: {{vehicles: 20, pedestrians: 60, spawn_radius_m: 120}}
"""


@pytest.fixture(scope="session", autouse=True)
def sites_are_drawn_once() -> Iterator[None]:
    """Every export draws the map of its sites, which for most tests are the same."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(map_masks, "draw_mask", once_for_each_site(map_masks.draw_mask))
        patch.setattr(expansion, "map_expansion", once_for_each_site(expansion.map_expansion))
        yield


def once_for_each_site(draw: Callable[[RoadNetwork, Site], Any]) -> Callable[[RoadNetwork, Site], Any]:
    """The function with a memory of what it has returned for sites of the same map and extent."""
    drawn: dict[object, Any] = {}

    def drawn_once(network: RoadNetwork, site: Site) -> Any:
        place = (site.map, site.name, site.low_m, site.high_m)
        if place not in drawn:
            drawn[place] = draw(network, site)
        return drawn[place]

    return drawn_once


@pytest.fixture(scope="session")
def nuscenes_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a made-up dataset of two scenes, ``set``, and its export to nuScenes' layout, ``out``."""
    folder = tmp_path_factory.mktemp("nuscenes")
    made_up_scene(folder / "set/scenes/train/Blocks-0000", ticks=23)
    made_up_scene(folder / "set/scenes/val/Blocks-0001", number=1, split="val", ticks=12)
    export(folder / "set", folder / "out")
    return folder


@pytest.fixture(scope="session")
def devkit_python() -> Path:
    """The Python of an environment with the nuscenes-devkit, installed once per user."""
    return python_with(devkit_environment(), DEVKIT)


@pytest.fixture(scope="session")
def t4_devkit_python() -> Path:
    """The Python of an environment with t4-devkit, whose old release on PyPI needs NumPy 1, installed once per user."""
    return python_with(default_cache_dir() / "t4-devkit-0.1.0", "t4-devkit==0.1.0", "pyarrow<20")


def python_with(folder: Path, *packages: str) -> Path:
    """The Python of an environment with packages."""
    python, ready = folder / "bin/python", folder / "ready"
    if not ready.exists():
        shutil.rmtree(folder, ignore_errors=True)
        try:
            subprocess.run([sys.executable, "-m", "venv", folder], check=True, capture_output=True)
            subprocess.run([python, "-m", "pip", "install", "-q", *packages], check=True, capture_output=True)
        except subprocess.CalledProcessError as error:
            pytest.skip(f"{packages[0]} cannot be installed: {error.stderr.decode()[-300:]}")
        ready.touch()
    return python


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a dataset of two scenes from a graph, ``set``, and its export to nuScenes' layout, ``out``."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "config.yaml").write_text(CONFIG)
    simbev, domain = (sys.executable, "-m", "simbev_ros.cli.main"), str(60 + os.getpid() % 38)
    words = ("run", folder / "config.yaml", "--record", folder / "set")
    run(*simbev, *words, environment={"ROS_DOMAIN_ID": domain})
    run(*simbev, "export", "nuscenes", folder / "set", "--out", folder / "out")
    return folder
