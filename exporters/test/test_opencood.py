"""OpenCOOD's own data set class opens an export, and finds boxes and points of all agents in place.

OpenCOOD's license allows its use for academic research alone, so it is not installed by tests. They run if
SIMBEV_TEST_OPENCOOD is the Python of an environment with OpenCOOD, such as opencoodx 0.1.19.
"""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from made_up_scene import SENSORS, made_up_spec, record_made_up
from processes import run
from several_agents import car, with_agents

from simbev_exporters.opv2v.export import export_opv2v
from simbev_exporters.opv2v.frames import FrameSettings
from simbev_ros.dataset import Frame, columns, open_dataset
from simbev_ros.foundation.geometry.transforms import apply, inverse
from simbev_ros.foundation.types import Float64Array

OPENCOOD = os.environ.get("SIMBEV_TEST_OPENCOOD", "")
MIRROR = [1, -1, 1]

pytestmark = pytest.mark.skipif(not OPENCOOD, reason="SIMBEV_TEST_OPENCOOD is not set")


def test_opencood_reads_agents_clouds_and_boxes(tmp_path: Path) -> None:
    spec = with_agents(made_up_spec(SENSORS, number=3, ticks=5), car("car", 2), car("van", 4))
    record_made_up(tmp_path / f"set/scenes/train/{spec.name}", spec)
    dataset = open_dataset(tmp_path / "set", threads=1)
    settings = FrameSettings()
    export_opv2v(dataset, tmp_path / "out", settings)
    frames = json.loads(run(OPENCOOD, Path(__file__).with_name("opencood_reading.py"), tmp_path / "out/train"))
    assert len(frames) == 3
    for tick, frame in zip((0, 2, 4), frames, strict=True):
        ego = dataset.scenes[0][tick]
        seen = {"1": ego, "3": ego.others["car"], "5": ego.others["van"]}
        assert frame["ego"] == "1" and set(frame["means"]) == set(seen)
        for folder, agent in seen.items():
            points = in_lidar(ego, apply(agent.map_from_sensor("lidar"), columns(agent["lidar/points"], "x", "y", "z")))
            np.testing.assert_allclose(frame["means"][folder], points.mean(axis=0), atol=1e-4)
        assert frame["centers"]
        for number, center in frame["centers"].items():  # each agent's boxes are made up, so one of them is meant
            boxes = np.concatenate([each["boxes"] for each in seen.values()])
            candidates = in_lidar(ego, columns(boxes[boxes["id"] == int(number)], "x", "y", "z"))
            assert np.abs(candidates - center).max(axis=1).min() < 1e-4


def in_lidar(frame: Frame, points_m: Float64Array) -> Float64Array:
    """(N, 3) points of the map in the left-handed frame of an agent's lidar."""
    return apply(inverse(frame.map_from_sensor("lidar")), points_m) * MIRROR
