"""Tests that a dataset's pages are complete, fetch nothing, show names as text, and that charts have the numbers."""

import os
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from html_page import Page
from made_up_scene import SENSORS, made_up_scene
from typer.testing import CliRunner

from simbev_ros.cli.main import app
from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.statistics import Statistics, statistics_of
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.show.pages.browsable_table import Cell, Column, browsable_table
from simbev_ros.show.pages.charts import Series, bars, curves, heat_map, histogram
from simbev_ros.show.pages.dataset_pages import dataset_page
from simbev_ros.show.pages.scene_columns import condition_cells, hazard_text
from simbev_ros.show.reports.svg_drawing import number, ticks

HOSTILE = '"><script>alert("&amp;")</script>'
COLUMNS = (
    *("scene", "map", "split", "light", "weather", "sun °", "vehicles", "pedestrians", "hazards", "collisions"),
    *("s", "boxes", "ego m", "MB"),
)


def write_report(dataset: Path, report: Path, *options: str) -> None:
    result = CliRunner().invoke(app, ["info", str(dataset), "--report", str(report), "--workers", "1", *options])
    assert result.exit_code == 0, result.output


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of two scenes."""
    dataset = tmp_path_factory.mktemp("made") / "set"
    made_up_scene(dataset / "scenes/train/Blocks-0000", ticks=4)
    made_up_scene(dataset / "scenes/val/Blocks-0001", number=1, split="val", ticks=4)
    return dataset


@pytest.fixture(scope="module")
def report(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the pages of the dataset."""
    folder = tmp_path_factory.mktemp("pages") / "report"
    write_report(dataset, folder)
    return folder


@pytest.fixture(scope="module")
def statistics(dataset: Path) -> Statistics:
    return statistics_of(open_dataset(dataset))


def read(page: Path) -> Page:
    return Page(page.read_text(encoding="utf-8"))


def test_the_main_page_has_a_row_for_each_scene_and_all_statistics(report: Path) -> None:
    page = read(report / "index.html")
    assert page.headings == [
        *("Scenes", "Scenes and traffic", "Maps", "Boxes", "Speed and size, class by class", "Bird's-eye view"),
        "Weather",
    ]
    heads, *rows = page.tables[0]
    assert heads == ["picture", *COLUMNS]
    assert [row[1:7] for row in rows] == [
        ["Blocks-0000", "Blocks", "train", "twilight", "rain", "0"],
        ["Blocks-0001", "Blocks", "val", "day", "rain", "10"],
    ]
    assert {"Histogram: Vehicles in a scene", "Map: Blocks", "Heat map: Car"} <= set(page.charts)


def test_every_picture_has_a_text_and_every_link_leads_to_a_file(report: Path) -> None:
    pages = [*report.rglob("*.html")]
    assert len(pages) == 3
    for path in pages:
        page = read(path)
        assert page.unlabeled == []
        images = [image["source"] for chart in page.charts.values() for image in chart["layout"].get("images", ())]
        targets = [*page.links, *page.pictures, *page.scripts, *images]
        assert len(images) == 1 and len(targets) > 5
        for target in targets:
            assert target == "#content" or (path.parent / target).resolve().is_file(), f"{path}: {target}"


def test_only_scripts_of_the_project_may_run(report: Path) -> None:
    for path in report.rglob("*.html"):
        (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', path.read_text(encoding="utf-8"))
        (scripts,) = re.findall(r"script-src ([^;]*);", policy)
        assert policy.startswith("default-src 'none';") and "unsafe" not in scripts
        assert {word for word in scripts.split() if not word.startswith("'sha256-")} == {"'self'", "file:"}


def test_the_page_of_a_scene_has_its_video_curves_and_parameters(report: Path) -> None:
    page = read(report / "index_files/scenes/Blocks-0001/index.html")
    assert page.pictures == ["sheet.jpg", "video.mp4"] or page.pictures == ["video.mp4", "sheet.jpg"]
    speed = page.charts["Line chart: Speed of the ego"]["data"][0]
    assert speed["x"] == pytest.approx([0.0, 0.05, 0.1, 0.15])
    path = page.charts["Map: Path of the ego"]["data"][0]
    assert path["x"] == pytest.approx([0.0, 5.0, 10.0, 15.0]) and path["y"] == pytest.approx([1.0] * 4)
    assert page.table("sensor")["radar_front"] == ["radar", "2.4, 0, 0.6 m, 0°", "every tick"]
    assert page.table("parameter")["Sun altitude"] == ["10", "10", "°"]
    assert page.links == ["#content", "../../../index.html", "../Blocks-0000/index.html"]


def test_a_report_named_html_is_that_page_with_a_folder_beside_it(dataset: Path, report: Path, tmp_path: Path) -> None:
    page = tmp_path / "first.html"
    write_report(dataset, page, "--no-videos")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["first.html", "first_files"]
    assert page.read_text().replace("first_files", "index_files") == (report / "index.html").read_text()
    assert not [*tmp_path.rglob("*.mp4")]
    assert read(tmp_path / "first_files/scenes/Blocks-0000/index.html").pictures == ["sheet.jpg"]


def test_pictures_and_videos_are_made_again_only_if_the_bag_is_newer(
    dataset: Path, report: Path, tmp_path: Path
) -> None:
    report = Path(shutil.copytree(report, tmp_path / "report"))
    kept, renewed = (report / f"index_files/scenes/{name}/video.mp4" for name in ("Blocks-0000", "Blocks-0001"))
    content, long_ago_ns = renewed.read_bytes(), 10**18
    kept.write_bytes(b"kept")
    renewed.write_bytes(b"old")
    os.utime(renewed, ns=(long_ago_ns, long_ago_ns))
    write_report(dataset, report)
    assert (kept.read_bytes(), renewed.read_bytes()) == (b"kept", content)


def test_the_pages_of_a_bag_without_pictures_have_none(tmp_path: Path) -> None:
    bag = tmp_path / "set/scenes/train/Blocks-0000"
    made_up_scene(bag, sensors=[SENSORS[-1]])
    page = tmp_path / "bag.html"
    write_report(bag, page)
    assert [row[1] for row in read(page).tables[0][1:]] == ["Blocks-0000"]


def test_names_from_data_are_shown_as_text(statistics: Statistics) -> None:
    scene = statistics.scenes[0]
    visited = {HOSTILE: statistics.visited[scene.map]}
    changed = replace(
        statistics, path=Path(HOSTILE), scenes=(replace(scene, name=HOSTILE, map=HOSTILE),), visited=visited
    )
    changed.tally.actors[HOSTILE] = 10_000
    text = dataset_page(changed, HOSTILE, {}, {HOSTILE})
    page = Page(text)
    del changed.tally.actors[HOSTILE]
    assert page.tables[0][1][1:3] == [HOSTILE, HOSTILE]
    assert "<script>alert" not in text and page.charts["Bar chart: Most frequent actors"]["data"][0]["y"][0] == HOSTILE
    assert all(re.fullmatch(r"[\w/.%#-]+", target) for target in (*page.links, *page.pictures, *page.scripts))


def test_a_filter_is_offered_only_where_values_differ() -> None:
    columns = [Column("a", "choice"), Column("b", "range", is_number=True), Column("c", "text")]
    table = browsable_table(
        "Things", columns, [[Cell("x y"), Cell(1), Cell("same")], [Cell("y"), Cell(3), Cell("same")]]
    )
    assert re.findall(r'<option value="(\w+)">', table) == ["x", "y"]
    assert re.findall(r'data-test="(\w+)" data-column="(\d)"', table) == [("choice", "0"), ("min", "1"), ("max", "1")]
    assert re.findall(r'placeholder="(\d+)"', table) == ["1", "3"]


def test_conditions_that_change_are_shown_and_chosen_by_their_start() -> None:
    start = Weather(**dict.fromkeys(Weather.model_fields, 0.0) | {"sun_altitude_deg": 30.0})
    end = start.model_copy(update={"sun_altitude_deg": -20.0, "precipitation": 50.0})
    cells = condition_cells(start, end)
    assert [cell.value for cell in cells] == ["day", "clear", 30]
    assert [cell.shown for cell in cells] == ["day → night", "clear → rain", "30 → -20"]
    assert hazard_text({"work_zone": 2, "accident": 1}) == "1 accident, 2 work zones"


def test_columns_have_their_numbers_and_empty_ones_at_the_end_are_cut_off() -> None:
    series = [Series("a", np.array([1, 0, 4, 0, 0])), Series("b", np.array([2, 0, 0, 0, 0])), Series("c", np.zeros(5))]
    chart = histogram(series, 5.0, "m", "boxes", start=10.0)
    assert [(each["name"], each["x"], each["y"]) for each in chart.data] == [
        ("a", [12.5, 17.5, 22.5], [1, 0, 4]),
        ("b", [12.5, 17.5, 22.5], [2, 0, 0]),
    ]
    assert chart.layout["xaxis"]["range"] == [10.0, 25.0] and chart.layout["barmode"] == "stack"


def test_bars_are_stacked_and_their_sums_written() -> None:
    chart = bars(["x", "<y>"], [Series("a", np.array([3.0, 1.0])), Series("b", np.array([1.0, 0]))], " %")
    assert [each["x"] for each in chart.data] == [[3, 1], [1, 0], [4, 1]]
    assert chart.data[-1]["text"] == [" 4 %", " 1 %"]


def test_curves_have_gaps_where_nothing_is_known() -> None:
    values = np.array([100.0, np.nan, 0.0, 1.0, np.nan])
    logarithmic, linear = (curves(np.arange(5.0), [Series("a", values)], "m", "", is_log=log) for log in (True, False))
    assert logarithmic.data[0]["y"] == [100, None, None, 1] and linear.data[0]["y"] == [100, None, 0, 1]


def test_heat_maps_place_their_cells_between_the_edges() -> None:
    trace = heat_map(np.ones((2, 4)), (0.0, 8.0), (-1.0, 1.0), "").data[0]
    assert (trace["x0"], trace["dx"], trace["y0"], trace["dy"]) == (1.0, 2.0, -0.5, 1.0)
    assert trace["z"]["shape"] == "2, 4"


def test_numbers_and_ticks_are_round() -> None:
    assert [number(value) for value in (0, 3.14159, 42.0, 1234, 56_789, 1.5e6, 0.00059)] == [
        *("0", "3.14", "42", "1,234", "56.8 k", "1.5 M", "0.00059")
    ]
    assert ticks(0, 100) == [0, 20, 40, 60, 80, 100] and ticks(-90, 90) == [-50, 0, 50]
    assert ticks(0, 2, min_step=1) == [0, 1, 2]
