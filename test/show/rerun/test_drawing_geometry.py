"""Geometry and text that the viewer draws: dashes, outer voxels, rows of cameras, the ego's outline, the sheet."""

import re
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from made_up_scene import SENSORS, made_up_spec

pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")
import rerun as rr

from simbev_ros.config.camera import Camera
from simbev_ros.config.load import load_scenario
from simbev_ros.scene.blueprints import blueprint_index, load_blueprints
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.schema.views import VIEW_DTYPE
from simbev_ros.show.rerun import cameras
from simbev_ros.show.rerun.blueprint import rows_of_cameras
from simbev_ros.show.rerun.cameras import dashed_boxes
from simbev_ros.show.rerun.clouds import has_free_side, thin_out
from simbev_ros.show.rerun.ground import ego_outline_px
from simbev_ros.show.rerun.scene_log import SceneLog
from simbev_ros.show.rerun.scene_sheet import scene_sheet
from simbev_ros.show.rerun.subject import Subject

BOXES_PX = np.array([(10.5, 20.5, 110.5, 60.5), (3.0, 3.0, 3.4, 3.2), (5.0, 5.0, 5.0, 5.0), (0.0, 0.0, 7.0, 400.0)])


@pytest.mark.parametrize("row", range(len(BOXES_PX)))
def test_dashes_lie_on_the_borders_and_reach_all_corners(row: int) -> None:
    dashes, rows = dashed_boxes(BOXES_PX, 5.0)
    left, top, right, bottom = BOXES_PX[row]
    ends = dashes[rows == row]
    x, y = ends[..., 0], ends[..., 1]
    along_x = np.isclose(y, top) | np.isclose(y, bottom)
    along_y = np.isclose(x, left) | np.isclose(x, right)
    assert (along_x.all(axis=1) | along_y.all(axis=1)).all()
    assert ((x >= left) & (x <= right) & (y >= top) & (y <= bottom)).all()
    for corner in ((left, top), (right, top), (right, bottom), (left, bottom)):
        assert np.isclose(ends, corner).all(axis=2).sum() >= 2, "a dash of each of its two sides ends there"


def test_dashes_and_gaps_are_about_as_long_as_asked() -> None:
    dashes, rows = dashed_boxes(BOXES_PX[:1], 5.0)
    upper = dashes[(dashes[..., 1] == 20.5).all(axis=1)]
    lengths_px, gaps_px = upper[:, 1, 0] - upper[:, 0, 0], upper[1:, 0, 0] - upper[:-1, 1, 0]
    assert len(upper) == 10 and (rows == 0).all()
    np.testing.assert_allclose([*lengths_px, *gaps_px], 100 / 19)


def test_without_boxes_there_are_no_dashes() -> None:
    dashes, rows = dashed_boxes(np.zeros((0, 4)), 5.0)
    assert (dashes.shape, rows.shape) == ((0, 2, 2), (0,))


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95, 1.0])
def test_voxels_with_a_free_side_are_those_that_brute_force_finds(share: float) -> None:
    shape = (6, 5, 4)
    indices = np.argwhere(np.random.default_rng(3).random(shape) < share)
    occupied = {tuple(index) for index in indices.tolist()}
    steps = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    expected = [any((x + dx, y + dy, z + dz) not in occupied for dx, dy, dz in steps) for x, y, z in indices.tolist()]
    assert has_free_side(indices.astype(np.int32), shape).tolist() == expected


@pytest.mark.parametrize(
    ("count", "limit", "step"), [(100, 100, 1), (101, 100, 2), (1000, 100, 10), (7, 2, 4), (0, 5, 1)]
)
def test_thinning_takes_every_nth_point_with_the_smallest_n(count: int, limit: int, step: int) -> None:
    points = np.zeros(count, [("x", np.float32)])
    points["x"] = np.arange(count)
    thinned = thin_out(points, limit)
    assert len(thinned) <= limit
    assert thinned["x"].tolist() == list(range(0, count, step))


def test_the_papers_cameras_are_in_two_rows_from_left_to_right() -> None:
    cameras = load_scenario("paper").rig.of_type(Camera)
    assert rows_of_cameras(cameras) == [
        ["cam_front_left", "cam_front", "cam_front_right"],
        ["cam_back_left", "cam_back", "cam_back_right"],
    ]


@pytest.mark.parametrize("yaw_deg", [0.0, 90.0, 180.0, -90.0, -135.0])
def test_one_camera_is_one_row(yaw_deg: float) -> None:
    assert rows_of_cameras([Camera(name="cam", type="camera", pose={"yaw_deg": yaw_deg})]) == [["cam"]]


def test_the_egos_outline_is_where_the_cells_around_it_are() -> None:
    spec = made_up_spec(SENSORS)
    grid = spec.agents[0].annotation.bev.grid
    length_m, width_m, _ = load_blueprints()[blueprint_index()["vehicle.sedan"]].size_m
    # In a picture, the center of the first pixel is at one half.
    columns, rows = ego_outline_px(agent_view(spec)).T - 0.5
    x_m = np.interp(rows, np.arange(grid.rows), grid.centers_ego[:, 0, 0])
    y_m = np.interp(columns, np.arange(grid.columns), grid.centers_ego[0, :, 1])
    front_m, left_m = length_m / 2, width_m / 2
    np.testing.assert_allclose(x_m, [0, front_m, front_m, -front_m, -front_m, front_m, front_m], atol=1e-9)
    np.testing.assert_allclose(y_m, [0, 0, left_m, left_m, -left_m, -left_m, 0], atol=1e-9)


def test_the_sheet_lists_the_map_and_the_sensors() -> None:
    sheet = scene_sheet(agent_view(made_up_spec(SENSORS)))
    assert sheet.startswith("| Scene | |\n|---|---|\n| name | Blocks-0000 |\n"), "no heading takes room"
    assert "| map | Blocks |" in sheet
    assert r"| cam\_front | camera, 32 x 24 px" in sheet


def test_the_sheet_escapes_markdown_in_names() -> None:
    spec = made_up_spec(SENSORS)
    name = "a|b *c* <img src=x> [d](e)"
    named = spec.model_copy(update={"map": spec.map.model_copy(update={"name": name})})
    sheet = scene_sheet(agent_view(named))
    assert r"| map | a\|b \*c\* \<img src=x\> \[d\]\(e\) |" in sheet
    assert not re.search(r"(?<!\\)[<*\[]", sheet)


class _Image(dict[str, Any]):
    """Samples with an image, and perhaps boxes."""

    def messages(self, key: str) -> list[Any]:
        return [self[key]]


def test_boxes_of_an_earlier_image_vanish_with_the_first_image_without_boxes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cameras, "color_jpeg", lambda *_: b"")
    logged: list[tuple[str, type]] = []
    log = SimpleNamespace(
        add=lambda entity, archetype: logged.append((entity.rpartition("cam_front/")[2], type(archetype)))
    )
    drawing = cameras.CameraDrawing(cast(SceneLog, log), Subject(agent_view(made_up_spec(SENSORS))), "cam_front")
    boxes = {"cam_front/boxes": np.zeros(2, VIEW_DTYPE)}
    counts = []
    for labels in (boxes, boxes, {}, {}, boxes):
        logged.clear()
        drawing.draw(_Image({"cam_front/rgb": None, **labels}))
        counts.append((("boxes", rr.Clear) in logged, ("boxes/visible", rr.Boxes2D) in logged))
    assert counts == [(False, True), (False, True), (True, False), (False, False), (False, True)]
