"""Boxes for recordings of real sensors come out in the frames of others, and are scored as by hand."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_recording import write_nuscenes

from simbev_ros.baselines.boxes import BOX_DTYPE
from simbev_ros.baselines.inference import Answer
from simbev_ros.baselines.recordings.model_inputs import FrameView, Photo, view_frame
from simbev_ros.baselines.recordings.nuscenes import nuscenes_frames
from simbev_ros.baselines.recordings.recording import OTHER_CLASS, Labels
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, inverse
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES
from simbev_ros.foundation.types import Table
from simbev_ros.schema.palette import class_color
from simbev_training.recordings.pictures import draw_frame
from simbev_training.recordings.results import kitti_lines, nuscenes_results, nuscenes_text, table_lines
from simbev_training.recordings.scores import frame_tallies, points_inside, scores

CAR, TRUCK, PEDESTRIAN = (BOX_CLASSES.index(name) for name in ("car", "truck", "pedestrian"))
OPTICAL_FROM_EGO = inverse(SENSOR_FROM_OPTICAL)
OPTICAL_FROM_EGO[1, 3] = 1.5  # the camera is 1.5 m above the ground
PHOTO = Photo(
    np.full((400, 1000, 3), 100, np.uint8), PinholeCamera(1000, 400, 500, 500, 500, 200), OPTICAL_FROM_EGO, np.zeros(3)
)


def boxes(*rows: tuple[int, float, float], score: tuple[float, ...] = ()) -> Table:
    """Boxes of 4 m x 2 m x 1.6 m on the ground: class, x and y of each."""
    table = np.zeros(len(rows), BOX_DTYPE)
    for row, (label, x, y) in zip(table, rows, strict=True):
        row["class"], row["x"], row["y"], row["z"] = label, x, y, 0.8
        row["length"], row["width"], row["height"] = 4.0, 2.0, 1.6
    table["score"] = score or 0.5
    return table


def view(*centers: tuple[float, float], photo: bool = False) -> FrameView:
    """A frame with ten points of the newest sweep, and an older one, at each center."""
    xy = np.repeat(np.array(centers, np.float32).reshape(-1, 2), 11, axis=0)
    points = np.column_stack([xy, np.full(len(xy), 0.8), np.arange(len(xy)) % 11 == 10]).astype(np.float32)
    return FrameView(points, {"image_2": PHOTO} if photo else {}, np.eye(4))


def scored(found: Table, labels: Labels, seen: FrameView, frames: int = 1) -> dict[str, Any]:
    tallies = frame_tallies(found, labels, seen, 5)
    assert tallies is not None
    return {score.name: score for score in scores([tallies] * frames)}


def test_points_of_the_newest_sweep_are_counted_in_turned_boxes() -> None:
    table = boxes((CAR, 10.0, 0.0), (CAR, 10.0, 0.0))
    table["yaw"][1] = np.pi / 2
    assert points_inside(table, view((10.0, 1.5)).points).tolist() == [0, 10]


def test_average_precision_and_recall_by_hand() -> None:
    truth = boxes((CAR, 10, 0), (CAR, 20, 0), (CAR, 30, 5))  # the third has no points
    found = boxes((CAR, 11.9, 0), (CAR, 0, 20), (CAR, 20, 1), (CAR, 30, 5), score=(0.9, 0.8, 0.7, 0.6))
    seen = view((10, 0), (20, 0))
    score = scored(found, Labels(truth), seen)["car"]
    # Right, wrong, right, does not count: precision 1 up to a recall of one half, then 2 / 3.
    assert (score.boxes, score.recall, score.interval) == (2, 1.0, None)
    assert score.precision == pytest.approx(0.5 + 0.5 * 2 / 3)


def test_vehicles_of_another_class_count_as_one_class_alone() -> None:
    found = scored(boxes((TRUCK, 10, 0)), Labels(boxes((CAR, 10, 0))), view((10, 0)))
    assert (found["car"].precision, found["car, truck, bus as one"].precision) == (0.0, 1.0)


def test_objects_of_other_classes_excuse_predictions() -> None:
    found, seen = boxes((CAR, 10, 0), (CAR, 20, 0), score=(0.9, 0.8)), view((10, 0), (20, 0))
    assert scored(found, Labels(boxes((OTHER_CLASS, 10, 0), (CAR, 20, 0))), seen)["car"].precision == 1.0
    assert scored(found, Labels(boxes((CAR, 20, 0))), seen)["car"].precision == 0.5


def test_where_an_image_has_no_labels_predictions_do_not_count() -> None:
    found = boxes((CAR, -10, 0), (CAR, 10, 2), (CAR, 20, 0), score=(0.9, 0.8, 0.7))  # behind, unlabeled, right
    area = np.array([[390.0, 200.0, 410.0, 260.0]])  # around 500 - 500 * 2 / 10
    labels, seen = Labels(boxes((CAR, 20, 0)), True, area), view((20, 0), photo=True)
    assert scored(found, labels, seen)["car"].precision == 1.0
    assert scored(found, labels._replace(unlabeled_px=area[:0]), seen)["car"].precision == 0.5
    assert frame_tallies(found, labels, view((20, 0)), 5) is None


def test_equal_frames_have_an_interval_without_width() -> None:
    score = scored(boxes((CAR, 10, 0)), Labels(boxes((CAR, 10, 0))), view((10, 0)), frames=3)["car"]
    assert (score.boxes, score.precision, score.interval) == (3, 1.0, (1.0, 1.0))


def test_lines_of_kitti_by_hand() -> None:
    table = boxes((CAR, 10, 2), (PEDESTRIAN, -10, 0), score=(0.75, 0.5))  # the second is behind the camera
    table["yaw"] = -np.pi / 2
    (line,) = kitti_lines(table, PHOTO).splitlines()
    name, _, _, *words = line.split()
    alpha, left, top, right, bottom, *rest = map(float, words)
    # It looks to the right, as rotation_y 0 does; its near side is 9 m away, from 4 m left to the middle.
    assert name == "Car" and rest == pytest.approx([1.6, 2.0, 4.0, -2.0, 1.5, 10.0, 0.0, 0.75], abs=1e-4)
    assert (left, top, right, bottom) == pytest.approx((500 - 2000 / 9, 200 - 50 / 9, 500, 200 + 750 / 9), abs=0.01)
    assert alpha == pytest.approx(np.arctan2(2.0, 10.0), abs=1e-4)


def test_results_of_nuscenes_are_in_the_frame_of_the_map(tmp_path: Path) -> None:
    write_nuscenes(tmp_path)
    frame = nuscenes_frames(tmp_path, "v1.0-mini")[1]
    table = boxes((CAR, 9, 3))
    table["yaw"], table["vx"] = np.pi / 2, 5.0
    (found,) = nuscenes_results(table, frame, view_frame(frame, (0,), None))
    assert found["translation"] == pytest.approx([12.0, 3.0, 0.8])  # the ego has moved by 3 m
    assert (found["size"], found["rotation"]) == (
        [2.0, 4.0, pytest.approx(1.6)],
        pytest.approx([0.5**0.5, 0, 0, 0.5**0.5]),
    )
    assert (found["velocity"], found["attribute_name"]) == (pytest.approx([5.0, 0.0]), "vehicle.moving")
    content = json.loads(nuscenes_text({"a": [found]}, has_cameras=False, has_lidar=True))
    assert content["meta"]["use_lidar"] and content["results"]["a"][0]["sample_token"] == "sample1"


def test_frames_without_boxes_or_labels_have_no_lines_and_no_scores() -> None:
    assert (kitti_lines(boxes(), PHOTO), table_lines("7", boxes())) == ("", "")
    assert scored(boxes(), Labels(boxes()), view((10, 0))) == {}
    assert scored(boxes(), Labels(boxes((CAR, 10, 0))), view((10, 0)))["car"].precision == 0.0


def test_lines_of_the_table() -> None:
    assert (
        table_lines("7", boxes((CAR, 1.5, -2)))
        == "7,car,1.5000,-2.0000,0.8000,4.0000,2.0000,1.6000,0.0000,0.0000,0.0000,0.5000\n"
    )


def test_a_picture_shows_boxes_from_above_and_in_the_image() -> None:
    cells = np.zeros((360, 360, len(BEV_CLASSES)), np.uint8)
    frames = [
        draw_frame(
            "a", view((20.0, 0.0), photo=True), Answer(cells, boxes((PEDESTRIAN, x, 0), score=(0.9,))), None, 0.3
        )
        for x in (20.0, 60.0)
    ]
    changed = np.abs(frames[0].astype(int) - frames[1]).max(axis=2) > 60
    rows, columns = np.nonzero(changed)
    image_height, size = round(1872 * 0.4), (1872 - 10) / 2
    above = (rows > 66 + image_height + 10) & (columns < 24 + size)
    # 20 m ahead of the middle of the left picture from above, 4 m long and 2 m wide.
    middle = np.array([66 + image_height + 10 + size * 0.3, 24 + size / 2])
    assert np.abs(np.median([rows[above], columns[above]], axis=1) - middle).max() < 12
    assert above.any() and (rows < 66 + image_height).any()
    red = np.array(class_color("pedestrian"))
    assert (np.abs(frames[0][rows, columns].astype(int) - red).max(axis=1) < 60).mean() > 0.3


def test_boxes_below_the_score_are_not_drawn() -> None:
    cells, seen = np.zeros((360, 360, len(BEV_CLASSES)), np.uint8), view((20.0, 0.0))
    pictures = [draw_frame("a", seen, Answer(cells, table), None, 0.6) for table in (boxes((CAR, 20, 0)), boxes())]
    assert (pictures[0] == pictures[1]).all()
