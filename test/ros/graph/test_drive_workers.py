"""A driver's drives are the same bytes, with the same scores, on one graph and on two side by side."""

from pathlib import Path
from typing import Any

import pytest
from commands import Simbev, write_small

from simbev_ros.dataset import open_dataset
from simbev_ros.evaluation.driving.recorded_drives import drives_of
from simbev_ros.recording.digest import topic_digests
from simbev_ros.recording.reader import SceneBag

pytestmark = [pytest.mark.graph, pytest.mark.slow]


def test_drives_do_not_depend_on_the_number_of_workers(simbev: Simbev, tmp_path: Path) -> None:
    more = "ego: {driver: path}\ndrive: {goal_m: 40, stack: drive-truth}\n"
    config = write_small(tmp_path, 6, more, without=["camera", "lidar", "radar"])
    config.write_text(config.read_text().replace("train: 1", "train: 2"))
    found: list[dict[str, Any]] = []
    for workers in (1, 2):
        out = tmp_path / f"out{workers}"
        code, output = simbev("generate", config, "--workers", str(workers), "--out", out).finish()
        assert code == 0, output
        scenes = open_dataset(out, threads=1).scenes
        assert len(scenes) == 2
        drives = {drive.scene: drive.figures for drive in drives_of(scenes)}
        assert all(figures["completed"] > 0.2 for figures in drives.values())
        digests = {}
        for scene in scenes:
            with SceneBag(scene.path) as bag:
                digests[scene.name] = topic_digests(bag)
        found.append({"drives": drives, "digests": digests})
    assert found[0] == found[1]
