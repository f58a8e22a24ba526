"""Tests that boxes and cells of a frame are drawn at their positions and in the colors of their outcomes."""

import base64
import io
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock
from xml.etree import ElementTree

import evaluated_dataset as made
import numpy as np
import pytest
from PIL import Image
from ros_messages import image
from scene_edits import with_ego

from simbev_ros.config.rig import Rig
from simbev_ros.dataset import Scene, open_dataset
from simbev_ros.evaluation.metrics.boxes import Predictions
from simbev_ros.evaluation.options import EvaluationOptions
from simbev_ros.evaluation.predictions.dataset_predictions import open_predictions, write_predictions
from simbev_ros.evaluation.predictions.score_grid import ScoreGrid
from simbev_ros.evaluation.scene_boxes import Outcomes
from simbev_ros.evaluation.scene_evaluation import outcomes_of
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.types import AnyArray
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.qos import QosProfile
from simbev_ros.show.reports.evaluation_cameras import camera_picture
from simbev_ros.show.reports.evaluation_grids import FALSE, MISSED, RIGHT, grid_pictures
from simbev_ros.show.reports.evaluation_pictures import marked_boxes, picture_half_extent_m, top_view

CAMERA = {
    "type": "camera",
    "name": "cam_front",
    "pose": {"z_m": 1.6},
    "rate_hz": 10,
    "width_px": 64,
    "height_px": 48,
    "horizontal_fov_deg": 90,
}


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """A scene with a camera that records even ticks only."""
    path = tmp_path_factory.mktemp("pictured") / "scenes" / "val" / made.NAMES[0]
    rig = Rig.model_validate({"sensors": [*made.SENSORS, CAMERA]})
    spec = with_ego(made.spec(0), rig=rig)
    with SceneBagWriter(path) as writer:
        writer.add_attachment("scene.json", "application/json", spec.model_dump_json().encode())
        for tick in range(4):
            stamp_ns = spec.stamp_ns(tick)
            messages = made.messages(stamp_ns, tick)
            if tick % 2 == 0:
                picture = image(stamp_ns, "rgb8", np.full((48, 64, 3), 40 * tick + 40, np.uint8))
                messages.append(("/ego/cam_front/rgb/image_raw", "sensor_msgs/msg/Image", picture))
            for topic, type_name, payload in messages:
                if tick == 0:
                    writer.add_topic(topic, type_name, QosProfile())
                writer.write(topic, stamp_ns, payload)
        writer.finish({"complete": "true", "ticks": "4"})
    return open_dataset(path.parents[2]).scenes[0]


def outcomes(scene: Scene, folder: Path, tick: int) -> Outcomes:
    """The near car is found, another one is predicted falsely 8 m to its left; two boxes are missed."""
    car = made.truth().take(np.array([3 * tick, 3 * tick]))
    folder.mkdir(exist_ok=True)
    both = Predictions(replace(car, center_m=car.center_m + np.array([[0, 0, 0], [0, 8.0, 0]])), np.array([0.9, 0.8]))
    write_predictions(folder / "boxes.parquet", [(scene.name, both)])
    said = open_predictions(folder / "boxes.parquet").scene(scene.name, scene.stamps_ns)
    return outcomes_of(scene, said, tick, EvaluationOptions())


def paths(svg: str) -> dict[str, list[AnyArray]]:
    """(P, 2) points of each path, by class."""
    found: dict[str, list[AnyArray]] = {}
    for path in ElementTree.fromstring(svg).iter("path"):
        numbers = np.array(re.findall(r"-?[\d.]+", path.attrib["d"]), float)
        found.setdefault(path.attrib["class"], []).append(numbers[: len(numbers) // 2 * 2].reshape(-1, 2))
    return found


def test_boxes_from_above_are_drawn_at_their_positions(scene: Scene, tmp_path: Path) -> None:
    result = outcomes(scene, tmp_path, 1)
    assert (
        picture_half_extent_m(result, 40.0) == pytest.approx(np.hypot(70, 8) + 6, abs=1e-3)
        and picture_half_extent_m(result, 90.0) == 90.0
    )
    drawn = paths(top_view(scene[1], marked_boxes(result), 80.0))
    middles = {kind: [points[:4].mean(axis=0).tolist() for points in drawn[kind]] for kind in drawn if kind != "ego"}
    assert middles == {
        "found": [pytest.approx([320, 320 - 4 * 10])],
        "answer": [pytest.approx([320, 320 - 4 * 10])],
        "false": [pytest.approx([320 - 4 * 8, 320 - 4 * 10])],
        "missed": [pytest.approx([320 - 4 * 8, 320 - 4 * 70], abs=0.1), pytest.approx([320, 320 + 4 * 30], abs=0.1)],
    }
    np.testing.assert_allclose(np.ptp(drawn["found"][0][:4], axis=0), [2 * 4, 4 * 4])


def test_boxes_in_a_camera_picture_are_drawn_as_of_its_stamp(scene: Scene, tmp_path: Path) -> None:
    """At that stamp the rear of the near car is 8 m ahead: half its width of 2 m is an eighth of 480 pixels."""
    for tick, kinds in ((3, {"found"}), (2, {"found", "false"})):
        result = outcomes(scene, tmp_path / f"{tick}", tick)
        picture, said = camera_picture(scene[tick], result, marked_boxes(result)) or ("", "")
        assert said == ("cam_front" if tick == 2 else "cam_front, 0.05 s before")
        drawn = paths(picture)
        assert kinds <= {kind.split()[0] for kind in drawn} <= kinds | {"missed"}
        (car,) = drawn["found wire"]
        np.testing.assert_allclose([car[:, 0].min(), car[:, 0].max()], [480 - 60, 480 + 60], atol=1)
        pixels = _pixels(picture).convert("RGB").getpixel((5, 5))
        assert pixels == pytest.approx((120, 120, 120), abs=2)


def test_a_scene_without_cameras_has_no_camera_picture(tmp_path: Path) -> None:
    scene = open_dataset(made.record(tmp_path / "set")).scenes[0]
    result = outcomes(scene, tmp_path, 1)
    assert camera_picture(scene[1], result, marked_boxes(result)) is None


def test_cells_that_differ_are_colored(scene: Scene) -> None:
    scores = made.scores(0)[[made.ROAD, made.CAR]] / np.float32(255)
    scores[0, 9, 0], scores[0, 15, 3], scores[1, 8, 9] = 0.5, 0.6, 0.0
    pictures = grid_pictures(scene[0], ScoreGrid(("road", "car"), scores, "here"), ("road", "car"))
    assert list(pictures) == ["truth", "predicted", "difference"]
    cells = np.asarray(_pixels(pictures["difference"]).convert("RGBA"))
    assert cells.shape == (made.CELLS, made.CELLS, 4)
    colors = [cells[cell].tolist() for cell in ((9, 0), (8, 9), (15, 3), (0, 0), (19, 19))]
    assert [color[:3] for color in colors[:4]] == [[*MISSED], [*MISSED], [*FALSE], [*RIGHT]] and colors[4][3] == 0
    truth, predicted = (np.asarray(_pixels(pictures[name]).convert("RGBA")) for name in ("truth", "predicted"))
    differ = (truth != predicted).any(axis=-1)
    assert np.argwhere(differ).tolist() == [[8, 9], [9, 0], [15, 3]]


def _pixels(svg: str) -> Image.Image:
    """The first picture in a drawing."""
    address = next(ElementTree.fromstring(svg).iter("image")).attrib["href"]
    return Image.open(io.BytesIO(base64.b64decode(address.partition("base64,")[2])))


def test_labels_of_another_frame_lie_where_they_belong() -> None:
    """A view 10 m further and turned left by 90 degrees sees what was 10 m ahead at its center, turned right."""
    grid = np.zeros((8, 8), np.uint16)
    view = SimpleNamespace(annotation=SimpleNamespace(bev=SimpleNamespace(grid=SimpleNamespace(cell_m=1.0))))

    def frame_at(x_m: float, yaw_rad: float) -> Any:
        pose = matrices_from_xyz_rpy(np.array([x_m, 0.0, 0.0]), np.array([0.0, 0.0, yaw_rad]))
        frame = MagicMock(map_from_ego=pose, scene=SimpleNamespace(view=view))
        frame.__contains__.side_effect = lambda name: name == "bev/labels"
        frame.__getitem__.side_effect = lambda name: grid
        return frame

    svg = top_view(frame_at(10.0, np.pi / 2), [], 32.0, frame_at(0.0, 0.0))
    right, down, turn_deg = map(float, re.findall(r"translate\(([-\d.]+) ([-\d.]+)\) rotate\(([-\d.]+)", svg)[0])
    scale = 640.0 / 64.0
    assert (right, down, turn_deg) == pytest.approx((-10.0 * scale, 0.0, 90.0), abs=0.01)
