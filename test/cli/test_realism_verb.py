"""``simbev realism`` on a made-up dataset and frames in the layouts of KITTI and nuScenes."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_scene import made_up_scene


@pytest.fixture
def frames(tmp_path: Path) -> Path:
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-20.0, 20.0, (500, 2)), rng.uniform(-2.0, 1.0, 500), rng.random(500)])
    (tmp_path / "frames/velodyne").mkdir(parents=True)
    points.astype(np.float32).tofile(tmp_path / "frames/velodyne/000000.bin")
    return tmp_path / "frames"


def test_figures_are_printed_and_written(simbev: Callable[..., Any], tmp_path: Path, frames: Path) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000")
    answer = simbev("realism", tmp_path / "set", "--against", frames, "--json", "--report", tmp_path / "page.html")
    assert answer.code == 0
    rows = json.loads(answer.out)
    assert {row["sensor"] for row in rows} == {"lidar"}
    assert {"steps of intensity", "intensity of 0 [%]"} <= {row["figure"] for row in rows}
    assert list(rows[0]["real"]) == ["velodyne (bin)"]
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "Intensity over range" in page
    assert "velodyne (bin)" in page
    table = simbev("realism", tmp_path / "set", "--against", frames)
    assert "steps of intensity" in table.out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["{set}", "--against", "{tmp}/nowhere"], "nowhere: has no samples"),
        (["{tmp}/nowhere", "--against", "{frames}"], "nowhere"),
        (["{set}", "--against", "{frames}", "--report", "{tmp}/no/page.html"], "no"),
    ],
)
def test_bad_places_are_one_line(
    simbev: Callable[..., Any], tmp_path: Path, frames: Path, arguments: list[str], message: str
) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000")
    places = {"set": tmp_path / "set", "tmp": tmp_path, "frames": frames}
    answer = simbev("realism", *(each.format(**places) for each in arguments))
    assert answer.code == 2
    assert message in answer.err
    assert answer.err.count("\n") == 1
