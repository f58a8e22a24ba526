"""Exports to COCO's, YOLO's and KITTI's layouts hold what was recorded, for readers that are not ours."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from kitti_reader import KittiFrame, Label
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval
from scipy.spatial.transform import Rotation

from simbev_exporters.coco.layout import Coco
from simbev_exporters.kitti.labels import image_boxes, poses_in_camera
from simbev_exporters.kitti.layout import Kitti
from simbev_exporters.labeled_images.export import export_images
from simbev_exporters.labeled_images.layout import Layout
from simbev_exporters.yolo.layout import Yolo
from simbev_exporters.yolo.outlines import outline
from simbev_ros.dataset import Frame, Scene, open_dataset
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, Table
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.views import VIEW_DTYPE

# pycocotools with NumPy 2
pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")
BAGS = Path(__file__).parents[2] / "test/recording/format_1"
CLASSES = ("car", "truck", "bus", "motorcycle", "bicycle", "pedestrian")
FULL_RATE_HZ = 20.0


@pytest.fixture(scope="module", params=["town", pytest.param("recorded", marks=[pytest.mark.slow, pytest.mark.graph])])
def dataset(request: pytest.FixtureRequest) -> Path:
    """A dataset with images of instances: two frames of a small camera, or two scenes of two cameras."""
    return BAGS / "town" if request.param == "town" else request.getfixturevalue("recorded") / "set"


def export(dataset: Path, out: Path, layout: Layout) -> list[Scene]:
    """Export a dataset; return its scenes."""
    opened = open_dataset(dataset, threads=1)
    done = export_images(opened, out, layout)
    assert not done.failures and sum(done.images.values()) > 0 < done.objects
    return list(opened.scenes)


def rate_of(dataset: Path) -> float:
    return FULL_RATE_HZ if dataset.name == "town" else 2.0


def seen(frame: Frame, camera: str) -> Table:
    views: Table = frame[f"{camera}/boxes"]
    return views[(views["visible_px"] > 0) & (views["class"] < len(CLASSES))]


def edges_of(mask: BoolArray) -> Float64Array:
    """Left, top, right, bottom of a mask, where the corner of the first pixel is 0, 0."""
    rows, columns = np.nonzero(mask)
    return np.array([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1], np.float64)


def test_pycocotools_finds_the_instances_of_every_image(dataset: Path, tmp_path: Path) -> None:
    scenes = {scene.name: scene for scene in export(dataset, tmp_path, Coco(rate_hz=rate_of(dataset)))}
    coco = COCO(tmp_path / "annotations/instances_train.json")
    assert {each["id"]: each["name"] for each in coco.dataset["categories"]} == dict(enumerate(CLASSES, 1))
    assert sorted(coco.imgs) == list(range(1, len(coco.imgs) + 1))
    for number, image in coco.imgs.items():
        frame, camera = scenes[image["scene"]][image["tick"]], image["camera"]
        instances, views = frame[f"{camera}/instance"], seen(frame, camera)
        file = tmp_path / "train" / image["file_name"]
        assert file.read_bytes() == bytes(frame.messages(f"{camera}/rgb")[-1].data), "as recorded"
        assert (image["height"], image["width"]) == instances.shape
        found = coco.loadAnns(coco.getAnnIds([number]))
        assert [each["track_id"] for each in found] == views["id"].tolist()
        for each, view in zip(found, views, strict=True):
            mask = instances == view["id"]
            np.testing.assert_array_equal(coco.annToMask(each).astype(np.bool_), mask)
            x, y, width, height = each["bbox"]
            np.testing.assert_allclose([x, y, x + width, y + height], edges_of(mask))
            assert each["area"] == mask.sum() and each["iscrowd"] == 0
            assert coco.cats[each["category_id"]]["name"] == CLASSES[view["class"]]


@pytest.mark.parametrize("kind", ["bbox", "segm"])
def test_perfect_answers_have_an_ap_of_1_by_pycocotools(dataset: Path, tmp_path: Path, kind: str) -> None:
    export(dataset, tmp_path, Coco(rate_hz=rate_of(dataset)))
    coco = COCO(tmp_path / "annotations/instances_train.json")
    answers: list[Any] = [{**each, "score": 0.5} for each in coco.dataset["annotations"]]
    judged = COCOeval(coco, coco.loadRes(answers), kind)
    judged.evaluate()
    judged.accumulate()
    judged.summarize()
    assert judged.stats[0] == pytest.approx(1.0)


def read_labels(out: Path, stem: str) -> list[tuple[int, Float64Array]]:
    """Category and (N, 2) shares of the image's size of each label."""
    rows = [line.split() for line in (out / f"labels/train/{stem}.txt").read_text().splitlines()]
    return [(int(row[0]), np.array(row[1:], np.float64).reshape(-1, 2)) for row in rows]


@pytest.mark.parametrize("segments", [False, True])
def test_yolos_labels_are_the_visible_pixels(dataset: Path, tmp_path: Path, segments: bool) -> None:
    scenes = {s.name: s for s in export(dataset, tmp_path, Yolo(segments=segments, rate_hz=rate_of(dataset)))}
    assert yaml.safe_load((tmp_path / "data.yaml").read_text()) == {
        "train": "images/train",
        "names": dict(enumerate(CLASSES)),
    }
    images = sorted((tmp_path / "images/train").iterdir())
    assert [path.stem for path in images] == sorted(path.stem for path in (tmp_path / "labels/train").iterdir())
    for path in images:
        name, camera, tick = path.stem.split("__")
        frame = scenes[name][int(tick)]
        views, instances = seen(frame, camera), frame[f"{camera}/instance"]
        size_px = np.array(cv2.imread(str(path)).shape[1::-1])
        labels = read_labels(tmp_path, path.stem)
        assert [category for category, _ in labels] == views["class"].tolist()
        for (_, shares), number in zip(labels, views["id"], strict=True):
            mask = instances == number
            if segments:
                assert_fills(shares * size_px, mask)
            else:
                (center, size), edges = shares * size_px, edges_of(mask)
                np.testing.assert_allclose([*(center - size / 2), *(center + size / 2)], edges, atol=1e-3)


def assert_fills(polygon_px: Float64Array, mask: BoolArray) -> None:
    """A polygon, filled as ultralytics does, is the mask with its holes filled, if that has one part."""
    assert len(polygon_px) > 2, "fewer corners would be read as a box"
    filled = np.zeros(mask.shape, np.uint8)
    cv2.fillPoly(filled, [polygon_px.astype(np.int32)], 1)
    parts, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    expected = np.zeros(mask.shape, np.uint8)
    cv2.drawContours(expected, parts, -1, 1, cv2.FILLED)
    assert (filled >= mask).all()
    if len(parts) == 1 and len(polygon_px) != 4:
        np.testing.assert_array_equal(filled, expected)


@pytest.mark.parametrize(
    ("rows", "extra_px"),
    [
        (["....", ".##.", ".##.", "...."], 0),
        (["....", ".#..", "....", "...."], 0),
        (["....", ".##.", "....", "...."], 0),
        (["###.", "#.#.", "###.", "...."], 1),  # the hole
        (["##..", "##..", "....", "..##", "..##"], 1),  # a pixel between the parts
        (["#...#", ".....", ".....", "#...#"], 10),  # lines between four parts
    ],
)
def test_outlines_fill_all_parts_of_a_mask(rows: list[str], extra_px: int) -> None:
    mask = np.array([[each == "#" for each in row] for row in rows])
    left, top, right, bottom = edges_of(mask)
    polygon = outline(mask, np.array([left, top]), np.array([right, bottom]))
    filled = np.zeros(mask.shape, np.uint8)
    cv2.fillPoly(filled, [polygon.astype(np.int32)], 1)
    assert len(polygon) > 2 and (filled >= mask).all()
    assert filled.sum() - mask.sum() <= extra_px


def kitti_frames(dataset: Path, out: Path) -> list[tuple[Frame, KittiFrame]]:
    """Frames of ``cam_front`` with their files."""
    scenes = {scene.number: scene for scene in export(dataset, out, Kitti(rate_hz=rate_of(dataset)))}
    numbers = (out / "ImageSets/train.txt").read_text().split()
    assert numbers == (out / "ImageSets/trainval.txt").read_text().split()
    assert (out / "ImageSets/val.txt").read_text() == (out / "ImageSets/test.txt").read_text() == ""
    for name, suffix in (("image_2", "png"), ("velodyne", "bin"), ("calib", "txt"), ("label_2", "txt")):
        assert sorted(p.name for p in (out / "training" / name).iterdir()) == sorted(f"{n}.{suffix}" for n in numbers)
    assert all(number == f"{int(number):06d}" for number in numbers), "as readers make names of numbers"
    return [(scenes[int(n) // 10_000][int(n) % 10_000], KittiFrame(out / "training", n)) for n in numbers]


def test_kittis_boxes_cover_their_objects_in_the_image(dataset: Path, tmp_path: Path) -> None:
    shares = []
    for frame, files in kitti_frames(dataset, tmp_path):
        image, views = files.image(), seen(frame, "cam_front")
        np.testing.assert_array_equal(image, frame["cam_front/rgb"])
        highest = np.array(image.shape[1::-1]) - 0.5
        for label, view in zip(files.labels(), views, strict=True):
            visible = edges_of(frame["cam_front/instance"] == view["id"]) - 0.5
            assert (label.box[:2] <= visible[:2] + 1).all() and (label.box[2:] >= visible[2:] - 1).all()
            assert label.truncated == pytest.approx(view["truncation"], abs=0.006)
            assert label.occluded == sum(view["visibility"] < limit for limit in (0.8, 0.4))
            x, _, z = label.location_m
            difference = label.rotation_y - np.arctan2(x, z) - label.alpha
            assert np.cos(difference) == pytest.approx(1.0) and abs(label.alpha) <= np.pi
            corners_m = label.corners_m()
            if (corners_m[:, 2] > 0.5).all():
                pixels = files.project(corners_m)
                low, high = (np.clip(each, -0.5, highest) for each in (pixels.min(axis=0), pixels.max(axis=0)))
                assert (low <= label.box[:2] + 1).all() and (high >= label.box[2:] - 1).all()
                shares.append(np.prod(label.box[2:] - label.box[:2] + 1) / np.prod(high - low + 1))
    assert np.median(shares) > 0.7, "the box around the corners is hardly larger"


def test_lidar_points_are_in_kittis_boxes_as_in_the_bag(dataset: Path, tmp_path: Path) -> None:
    counts = []
    for frame, files in kitti_frames(dataset, tmp_path):
        cloud, points_m = frame["lidar/points"], files.points_in_camera()
        np.testing.assert_array_equal(files.cloud(), np.stack([cloud[n] for n in ("x", "y", "z", "intensity")], axis=1))
        points = dict(zip(frame["boxes"]["id"].tolist(), frame["boxes"]["lidar_points"].tolist(), strict=True))
        views = seen(frame, "cam_front")
        for label, number in zip(files.labels(), views["id"].tolist(), strict=True):
            counts.append((label.contains(points_m).sum(), points[number]))
    found, expected = np.array(counts).T
    assert expected.sum() > 0
    assert found.sum() == pytest.approx(expected.sum(), rel=0.1), (
        "boxes are level with the camera, and touch the ground"
    )
    assert np.median(np.abs(found - expected)) <= 1


@pytest.mark.parametrize("yaw", [-3.0, -1.2, 0.0, 0.4, 2.2])
def test_kittis_poses_are_those_of_boxes_level_with_the_camera(yaw: float) -> None:
    """The camera looks along the map's y axis from a height of 2 m."""
    box = np.zeros(1, BOX_DTYPE)
    for name, value in {"x": 3, "y": 20, "z": 1, "length": 4, "width": 2, "height": 1.5, "yaw": yaw}.items():
        box[name] = value
    optical_from_map = np.array([[1.0, 0, 0, 0], [0, 0, -1, 2], [0, 1, 0, 0], [0, 0, 0, 1]])
    (row,) = poses_in_camera(box, optical_from_map)
    label = Label("Car", 0, 0, row[7], np.zeros(4), row[:3], row[3:6], row[6])
    around = np.array([[x, y, z] for x in (-2, 2) for y in (-1, 1) for z in (-0.75, 0.75)])
    map_m = np.array([3, 20, 1]) + Rotation.from_euler("z", np.float32(yaw)).apply(around)
    expected = map_m @ optical_from_map[:3, :3].T + optical_from_map[:3, 3]
    np.testing.assert_allclose(sort_rows(label.corners_m()), sort_rows(expected), atol=1e-6)
    np.testing.assert_allclose(label.location_m, [3, 1.75, 20])
    ahead = Rotation.from_rotvec([0, label.rotation_y, 0]).apply([1, 0, 0])
    np.testing.assert_allclose(ahead, [np.cos(yaw), 0, np.sin(yaw)], atol=1e-6)


def sort_rows(rows: AnyArray) -> AnyArray:
    return rows[np.lexsort(np.round(rows, 4).T)]


def test_boxes_in_the_image_of_a_fisheye_are_around_what_its_rectified_image_shows() -> None:
    camera = FisheyeCamera(640, 480, 185.0, 180.0, 310.0, 250.0, (0.02, -0.004, 0.001, 0.0), float(np.radians(97.0)))
    views = np.zeros(4, VIEW_DTYPE)
    outlines = [(200, 150, 260, 200), (20, 200, 120, 300), (-0.5, 0, 639.5, 479.5), (0, 0, 40, 40)]  # the last: outside
    for side, values in zip(("left", "top", "right", "bottom"), np.transpose(outlines), strict=True):
        views[f"amodal_{side}"] = values
    sides = image_boxes(views, camera)
    corners = np.array([[u, v] for u in (200, 260) for v in (150, 200)], float)[:, None]
    plane = cv2.fisheye.undistortPoints(corners, camera.matrix, np.array(camera.distortion), P=camera.matrix)[:, 0]
    np.testing.assert_allclose(sides[0], [*plane.min(axis=0), *plane.max(axis=0)], atol=3.0)
    assert sides[1][0] == -0.5 and 0.0 < sides[1][2] < 120.0 and sides[1][1] < 200.0 and sides[1][3] > 300.0
    np.testing.assert_allclose(sides[2], [-0.5, -0.5, 639.5, 479.5])
    assert np.isnan(sides[3]).all()


def test_kittis_images_and_boxes_of_a_lens_are_rectified(tmp_path: Path) -> None:
    (scene,) = export(BAGS / "rainy_night", tmp_path, Kitti(rate_hz=FULL_RATE_HZ))
    known = scene.calibration["cam_front"]
    maps = cv2.initUndistortRectifyMap(
        known.intrinsics, known.distortion, np.eye(3), known.intrinsics, known.size_px, cv2.CV_32FC1
    )
    for frame in scene:
        files = KittiFrame(tmp_path / "training", f"{frame.tick:06d}")
        expected = cv2.remap(frame["cam_front/rgb"], *maps, cv2.INTER_LINEAR)
        assert np.abs(files.image().astype(int) - expected).mean() < 0.5
        instances = cv2.remap(frame["cam_front/instance"], *maps, cv2.INTER_NEAREST)
        for label, view in zip(files.labels(), seen(frame, "cam_front"), strict=True):
            edges = edges_of(instances == view["id"]) - 0.5
            np.testing.assert_allclose(label.box, edges, atol=1.5)
