"""The scenario of the guide in a running graph: boxes where its formulas say, events in the bag, a replay alike."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from commands import Simbev, digests

from simbev_ros.dataset import open_dataset
from simbev_ros.foundation.units import NS_PER_S

pytestmark = [pytest.mark.graph, pytest.mark.slow]

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/guide/openscenario.md").read_text(encoding="utf-8")
REPLAY = """
scenes: [{map: Blocks, train: 1}]
rig: rigs/live.yaml
annotation: {bev: {rows: 200, columns: 200, cell_m: 0.5}}
"""
Y0, SPEED, LEAD = -118.03, 12.0, 16.0  # of the road's reference line, which runs along x from -216.66
EGO_CENTER, VAN_CENTER = 1.4, 1.8


def van_m(t: float) -> tuple[float, float]:
    """Center of the van's box: from 1 s on it changes lanes in 2 s, from 3 s on it brakes with 4 m/s²."""
    braked = min(max(t - 3.0, 0.0), SPEED / 4.0)
    along = SPEED * min(t, 3.0) + SPEED * braked - 2.0 * braked**2
    u = min(max((t - 1.0) / 2.0, 0.0), 1.0)
    lateral_mps = 3.5 * math.pi / 4.0 * math.sin(math.pi * u)
    yaw_rad = math.atan2(lateral_mps, SPEED)
    x_m, y_m = -216.66 + 10.0 + LEAD + along, Y0 - 5.25 + 3.5 * (1.0 - math.cos(math.pi * u)) / 2.0
    return x_m + VAN_CENTER * math.cos(yaw_rad), y_m + VAN_CENTER * math.sin(yaw_rad)


def test_the_command_of_the_page_records_what_the_scenario_says(
    simbev: Simbev, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (command,) = re.findall(r"```sh\n\./simbev (.*)\n```", PAGE)
    verb, file, option, out = command.split()
    code, output = simbev(verb, ROOT / file, option, tmp_path / out).finish()
    assert code == 0, output
    scene = open_dataset(tmp_path / out).scenes[0]
    assert scene.spec.split == "test" and len(scene) == 141  # the stop trigger is true at 7 s
    names = {e["type"]: e for e in scene.records("world/events")}
    van = names["scenario.entity.Van"]["ids"][0]
    assert [e["type"] for e in scene.records("world/events")][-1] == "scenario.stop"
    begins = names["scenario.CutIn/Act/VanGroup/VanManeuver/ChangeLane.begin"]
    assert begins["tick"] == 20 and begins["ids"] == [van]
    for frame in scene:
        t = (frame.stamp_ns - scene.spec.start_ns) / NS_PER_S
        if abs(t - round(t)) > 1e-6:
            continue
        (row,) = frame["world/actors"][frame["world/actors"]["id"] == van]
        np.testing.assert_allclose([row["x"], row["y"]], van_m(t), atol=0.01)
        (box,) = frame["boxes"][frame["boxes"]["id"] == van]  # at half the height, on a road that falls to the side
        np.testing.assert_allclose([box["x"], box["y"]], van_m(t), atol=0.04)
        (ego,) = frame["world/actors"][frame["world/actors"]["id"] == 1]
        if t <= 3.0:
            assert ego["x"] == pytest.approx(-206.66 + EGO_CENTER + SPEED * t, abs=0.01)
        assert (frame["lidar/points"].size, frame["cam_front/rgb"].size) > (0, 0)

    (tmp_path / "replay.yaml").write_text(REPLAY)
    bag = tmp_path / out / "scenes/test/Blocks-0000"
    code, output = simbev("replay", bag, tmp_path / "replay.yaml", "--out", tmp_path / "replayed").finish()
    assert code == 0, output
    assert digests(tmp_path / "replayed" / "scenes/test/Blocks-0000") == digests(bag)
