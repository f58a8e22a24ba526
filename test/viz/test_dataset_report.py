"""Tests that a dataset report is one self-contained page and that its charts match the numbers."""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from html_page import Page
from made_up_scene import made_up_scene
from typer.testing import CliRunner

from simbev_ros.cli.main import app
from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.statistics import statistics_of
from simbev_ros.viz.reports.dataset_report import dataset_report
from simbev_ros.viz.reports.svg_charts import Series, bars, curves, histogram
from simbev_ros.viz.reports.svg_drawing import number, ticks


@pytest.mark.parametrize("single", [True, False])
def test_the_report_of_a_dataset_or_a_bag_is_self_contained(tmp_path: Path, single: bool) -> None:
    bag = tmp_path / "set/scenes/train/Blocks-0000"
    made_up_scene(bag)
    report = tmp_path / "report.html"
    result = CliRunner().invoke(app, ["info", str(bag if single else tmp_path / "set"), "--report", str(report)])
    assert result.exit_code == 0, result.output
    text = report.read_text(encoding="utf-8")
    page = Page(text)
    assert page.pictures and page.drawings
    assert page.headings == [
        *("Scenes", "Boxes", "Speed and size, class by class", "Bird's-eye view", "Maps", "Weather", "All scenes")
    ]


def test_columns_are_as_high_as_their_numbers() -> None:
    svg = ElementTree.fromstring(
        histogram([Series("a", np.array([1, 0, 4, 0, 0])), Series("b", np.array([2, 0, 0, 0, 0]))], 5.0, "m", "boxes")
    )
    rects = [{name: float(rect.attrib[name]) for name in ("x", "y", "width", "height")} for rect in svg.iter("rect")]
    assert [rect["height"] / rects[0]["height"] for rect in rects] == pytest.approx([1, 4, 2], rel=1e-3)
    assert rects[2]["y"] + rects[2]["height"] == pytest.approx(rects[0]["y"], abs=0.02)  # b stands on a
    assert rects[1]["x"] > rects[0]["x"] + rects[0]["width"] and len(rects) == 3


def test_bars_are_as_long_as_their_numbers() -> None:
    svg = ElementTree.fromstring(
        bars(["x", "<y>"], [Series("a", np.array([3.0, 1.0])), Series("b", np.array([1.0, 0]))])
    )
    widths = [float(rect.attrib["width"]) for rect in svg.iter("rect")]
    assert [width / widths[1] for width in widths] == pytest.approx([3, 1, 1, 0], abs=0.01)
    assert [text.text for text in svg.iter("text")] == ["x", "4", "<y>", "1"]


def test_curves_are_logarithmic_and_have_gaps() -> None:
    values = np.array([100.0, 10.0, 0.0, 1.0])
    svg = ElementTree.fromstring(curves(np.arange(4.0), [Series("a", values)], "m", "points"))
    lines = [[tuple(map(float, p.split(","))) for p in line.attrib["points"].split()] for line in svg.iter("polyline")]
    assert [len(line) for line in lines] == [2, 1]
    assert lines[0][1][1] - lines[0][0][1] == pytest.approx((lines[1][0][1] - lines[0][0][1]) / 2, abs=0.2)


def test_numbers_and_ticks_are_round() -> None:
    assert [number(value) for value in (0, 3.14159, 42.0, 1234, 56_789, 1.5e6, 0.00059)] == [
        *("0", "3.14", "42", "1,234", "56.8 k", "1.5 M", "0.00059")
    ]
    assert ticks(0, 100) == [0, 20, 40, 60, 80, 100] and ticks(-90, 90) == [-50, 0, 50]
    assert ticks(0, 2, min_step=1) == [0, 1, 2]


def test_names_from_data_are_shown_as_text(tmp_path: Path) -> None:
    hostile = '<script>alert("&amp;")</script>'
    bag = tmp_path / "<script>" / "Blocks-0000"
    made_up_scene(bag)
    statistics = statistics_of(open_dataset(bag))
    (scene,) = statistics.scenes
    statistics.tally.actors[hostile] = 10_000
    page = Page(
        dataset_report(
            replace(
                statistics,
                path=bag.parent,
                scenes=(replace(scene, name=hostile, map=hostile),),
                visited={hostile: statistics.visited[scene.map]},
            )
        )
    )
    assert hostile in page.table("scene")
    texts = [text for drawing in page.drawings for text in drawing.itertext()]
    for shown in (hostile, f"{hostile}, actors: 10 k", f"{hostile}, train"):
        assert shown in texts
