"""Tests that t4-devkit opens the export of a recorded scene and finds everything at its position."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import run

from simbev_exporters.t4.export import T4Settings, export_t4
from simbev_ros.dataset import Scene, open_dataset

CHECKS = Path(__file__).with_name("t4_devkit_checks.py")

pytestmark = [pytest.mark.slow, pytest.mark.graph]


@pytest.fixture(scope="module")
def scene(recorded: Path) -> Scene:
    return open_dataset(recorded / "set", threads=1).scenes[0]


@pytest.fixture(scope="module")
def found(t4_devkit_python: Path, recorded: Path, scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Results of the devkit's checks of a recorded scene."""
    folder = tmp_path_factory.mktemp("t4-devkit")
    export_t4(open_dataset(recorded / "set", threads=1), folder / "out", T4Settings(2.0))
    run(t4_devkit_python, CHECKS, folder / "out" / scene.name, folder / "found.json", environment={"PYTHONPATH": ""})
    return json.loads((folder / "found.json").read_text())


def test_the_devkit_counts_the_same_points_in_boxes(found: Any) -> None:
    fewest, stated, most = np.array(found["counted"]).T
    assert stated.sum() > 100
    assert np.all((fewest <= stated) & (stated <= most)), "points on faces may count or not"
    assert {"car", "pedestrian"} <= {*found["categories"]} and found["boxes_2d"] > 10


def test_the_devkit_projects_boxes_around_the_silhouettes_of_objects(found: Any, scene: Scene) -> None:
    frames = {frame.stamp_ns // 1000: frame for frame in scene}
    count = 0
    for each in found["views"]:
        for channel, boxes in each["views"].items():
            for view in frames[each["timestamp"]][f"{channel.lower()}/boxes"]:
                name = f"{scene.name}::{view['id']}"
                if name in boxes and view["truncation"] == 0 and view["visible_px"] > 0:
                    silhouette = np.array([view[f"amodal_{side}"] for side in ("left", "top", "right", "bottom")])
                    inner = (silhouette - boxes[name]) * [1, 1, -1, -1]
                    assert inner.min() > -0.5, f"{name} in {channel}: it leaves its box"
                    count += 1
    assert count > 20
