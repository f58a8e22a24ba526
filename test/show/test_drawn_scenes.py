"""Tests of the page of drawn scenes: maps with start, route and hazards, and a row of parameters for each scene."""

import re
from pathlib import Path

import numpy as np
import pytest
from html_page import Page
from typer.testing import CliRunner, Result

from simbev_ros.cli.main import app
from simbev_ros.config.load import load_scenario
from simbev_ros.maps.build import load_network
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.scene.streets.vehicle_route import draw_vehicle_route, duration_s, route_line_m
from simbev_ros.show.pages.drawn_scenes import MAX_SCENES

CONFIG = """
seed: 3
scenes: [{map: Blocks, train: 1, val: 1}]
time: {warm_up_s: 1, duration_s: 20}
rig: {sensors: [{type: gnss, name: gnss}]}
traffic: {vehicles: 4, pedestrians: 3}
hazards: {count: 1, accident_share: 1}
weather: {precipitation: 40, sun_altitude_deg: -30}
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("drawn") / "plan.yaml"
    path.write_text(CONFIG)
    return path


@pytest.fixture(scope="module")
def text(config: Path) -> str:
    """The page of three scenes, drawn by one process."""
    return page_of(config, config.with_name("scenes.html"), workers=1)


def draw(config: Path, *options: object) -> Result:
    return CliRunner().invoke(app, ["scene", str(config), *map(str, options)])


def page_of(config: Path, out: Path, workers: int) -> str:
    result = draw(config, "--count", 3, "--out", out, "--workers", workers)
    assert result.exit_code == 0, result.output
    return out.read_text(encoding="utf-8")


def test_each_drawn_scene_has_a_map_and_its_parameters(text: str) -> None:
    page = Page(text)
    assert page.scripts == [] and page.unlabeled == [] and len(page.drawings) == 3
    assert all(address.startswith("data:image/jpeg;base64,") for address in page.pictures)
    heads, *rows = page.tables[0]
    row = dict(zip(heads[1:], rows[1][1:], strict=True))
    assert [row[name] for name in ("scene", "split", "light", "weather", "pedestrians", "hazards")] == [
        *("Blocks-0001", "val", "night", "rain", "3", "1 accident")
    ]
    assert [len(drawing.findall("polygon")) for drawing in page.drawings] == [1, 1, 1]
    assert "Blocks-0002" in page.drawings[2].attrib["aria-label"]


def test_the_page_is_the_same_however_many_processes_draw_it(config: Path, text: str) -> None:
    assert page_of(config, config.with_name("by-two.html"), workers=2) == text


def test_routes_start_where_the_ego_does_and_are_as_long_as_it_drives(config: Path) -> None:
    scenario = load_scenario(str(config))
    planned = next(planned_scenes(scenario))
    network = load_network(planned.map)
    spec = draw_scene(scenario, planned, network)
    ego, line_m = spec.vehicles[0], route_line_m(spec, network, 0)
    start_m, _ = network.pose_on_lane(ego.start.lane, ego.start.s_m)
    steps_m = np.linalg.norm(np.diff(line_m, axis=0), axis=1)
    limits_mps = {
        lane.speed_mps for edge in draw_vehicle_route(spec, network, 0).edges for lane in network.lanes_of_edge(edge)
    }
    middles_m = (line_m[1:] + line_m[:-1]) / 2
    off_m = np.linalg.norm(network.nearest_lane(middles_m).position_m[:, :2] - middles_m, axis=1)
    assert np.allclose(line_m[0], start_m[:2]) and off_m.max() < 4.0
    assert steps_m.sum() <= max(limits_mps) * ego.speed_factor * duration_s(spec) + 1.0
    assert steps_m.sum() > 0.3 * max(limits_mps) * ego.speed_factor * duration_s(spec)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--count", MAX_SCENES + 1, "--out", "OUT/a.html"), f"--count: is {MAX_SCENES + 1}; allowed with --out: 1 to"),
        (("--json", "--out", "OUT/a.html"), "--json and --out exclude each other"),
        (("--out", "OUT/none/a.html"), "there is no folder"),
        (("--out", "OUT"), "is a folder, not a file"),
    ],
)
def test_what_cannot_be_written_is_refused(
    config: Path, tmp_path: Path, options: tuple[object, ...], message: str
) -> None:
    result = draw(config, *(str(option).replace("OUT", str(tmp_path)) for option in options))
    assert result.exception is not None and message in str(result.exception)
    assert not re.search("a.html", " ".join(path.name for path in tmp_path.iterdir()))


def test_entities_of_a_scenario_are_counted_and_on_the_map(tmp_path: Path) -> None:
    out = tmp_path / "scenes.html"
    assert draw(Path(__file__).parents[2] / "examples/cut_in.xosc", "--out", out, "--workers", 1).exit_code == 0
    page = out.read_text(encoding="utf-8")
    assert "<title>ego</title>" in page and "<title>Van</title>" in page
    assert "<b>1</b><span>scene</span>" in page and "<b>2</b><span>vehicles</span>" in page
    assert 'class="route"' not in page  # the storyboard moves the ego, not traffic
