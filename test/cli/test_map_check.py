"""``simbev map --check``: findings with their lines, a table of rules, a picture, and the exit code."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

ROAD = """<road id="{id}" length="{length}" junction="-1"><planView>
<geometry s="0" x="0" y="{y}" hdg="0" length="{length}"><{shape}/></geometry></planView><lanes><laneSection s="0">
<center><lane id="0" type="none"/></center><right><lane id="-1" type="driving">
<width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection></lanes></road>
"""
GEO = "<geoReference>+proj=tmerc +lat_0=48 +lon_0=9</geoReference>"


@pytest.fixture
def damaged(tmp_path: Path) -> Path:
    """A road of 150 m, and one of 50 m with its id."""
    path = tmp_path / "two roads.xodr"
    good, bad = ROAD.format(id=1, length=150, y=0, shape="line"), ROAD.format(id=1, length=50, y=60, shape="line")
    path.write_text(f'<OpenDRIVE><header revMajor="1" revMinor="4">{GEO}</header>\n{good}{bad}</OpenDRIVE>')
    return path


def test_each_finding_has_its_line_and_a_loss_of_lanes_ends_with_one(simbev: Callable[..., Any], damaged: Path) -> None:
    answer = simbev("map", damaged, "--check")
    assert answer.code == 1
    assert "two roads.xodr:6: left out: a road with the id of an earlier one is left out (road 1)" in answer.out
    assert re.search(r"left out +a road with the id of an earlier one is left out +1 +0\.05", answer.out)
    assert "two roads.xodr: 25.00 % of the driving lanes are lost; allowed: 1 %" in answer.out


def test_the_allowed_loss_can_be_chosen(simbev: Callable[..., Any], damaged: Path) -> None:
    facts = json.loads(simbev("map", damaged, "--check", "--max-loss", "20", "--json").out)
    assert facts["loss_percent"] == pytest.approx(25.0)
    (finding,) = (each for each in facts["findings"] if each["outcome"] == "left out")
    assert (finding["line"], finding["outcome"], finding["position_m"]) == (6, "left out", [0.0, 60.0])
    assert finding["lost_m"] == 50.0


def test_the_picture_marks_the_place(simbev: Callable[..., Any], damaged: Path, tmp_path: Path) -> None:
    simbev("map", damaged, "--check", "--out", tmp_path / "map.png")
    picture = cv2.imread(str(tmp_path / "map-check.png"))[..., ::-1]
    assert picture.shape == (1400, 1400, 3)
    red = np.argwhere(np.abs(picture[120:].astype(int) - (208, 42, 42)).sum(axis=2) < 20)
    assert len(red) > 100, "a ring, below the legend"


def test_control_characters_in_a_map_do_not_reach_the_terminal(simbev: Callable[..., Any], damaged: Path) -> None:
    hostile = damaged.rename(damaged.with_name(f"a\x1b[31m\x9b{damaged.name}"))
    lines = simbev("map", hostile, "--check").out.splitlines()
    assert {lines[0].partition(":")[0], lines[-1].partition(":")[0]} == {rf"a\x1b[31m\x9b{damaged.name}"}


def test_a_map_without_findings_passes(simbev: Callable[..., Any]) -> None:
    answer = simbev("map", "Blocks", "--check")
    assert answer.code == 0
    assert answer.out == "Blocks: 0.00 % of the driving lanes are lost; allowed: 1 %\n"


def test_a_check_needs_a_map(refused: Callable[..., str]) -> None:
    assert "--check: needs a map" in refused("map", "--check")


def test_a_check_writes_no_other_form(refused: Callable[..., str], damaged: Path, tmp_path: Path) -> None:
    assert "not with --to, --at or --all" in refused("map", damaged, "--check", "--to", tmp_path / "map.osm")
