"""Overlap of boxes, compared with shapely's polygons and worked out by hand."""

import numpy as np
import pytest
import shapely
from made_up_boxes import some_boxes

from simbev_ros.evaluation.metrics.boxes import Boxes
from simbev_ros.evaluation.metrics.overlap import aligned_iou, iou_of_pairs
from simbev_ros.foundation.types import Float64Array

PAIRS = 10_000


def polygons(boxes: Boxes) -> Float64Array:
    corners_m = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * boxes.size_m[:, None, :2] / 2
    cos, sin = np.cos(boxes.yaw_rad)[:, None], np.sin(boxes.yaw_rad)[:, None]
    x_m = boxes.center_m[:, :1] + corners_m[..., 0] * cos - corners_m[..., 1] * sin
    y_m = boxes.center_m[:, 1:2] + corners_m[..., 0] * sin + corners_m[..., 1] * cos
    return shapely.polygons(np.stack([x_m, y_m], axis=-1))


def reference_iou(boxes: Boxes, others: Boxes) -> Float64Array:
    area_m2 = shapely.area(shapely.intersection(polygons(boxes), polygons(others)))
    low_m, high_m = (
        np.stack([each.center_m[:, 2] + sign * each.size_m[:, 2] / 2 for each in (boxes, others)]) for sign in (-1, 1)
    )
    common_m3 = area_m2 * np.maximum(high_m.min(axis=0) - low_m.max(axis=0), 0)
    union_m3 = boxes.size_m.prod(axis=1) + others.size_m.prod(axis=1) - common_m3
    return np.divide(common_m3, union_m3, out=np.zeros_like(union_m3), where=union_m3 > 0)


def random_pairs(rng: np.random.Generator, kind: str) -> tuple[Boxes, Boxes]:
    """Pairs of boxes on a map, far from its origin."""
    position_m = rng.uniform(-3000, 3000, (PAIRS, 3))
    size_m, other_size_m = rng.uniform(0.2, 12, (2, PAIRS, 3))
    yaw_rad, other_yaw_rad = rng.uniform(-4, 4, (2, PAIRS))
    offset_m = rng.normal(0, 2, (PAIRS, 3))
    if kind != "any":
        other_yaw_rad = yaw_rad + rng.integers(0, 4, PAIRS) * np.pi / 2
        along_m = {
            "touching": (size_m[:, 0] + np.where(np.arange(PAIRS) % 2, size_m[:, 0], size_m[:, 1])) / 2,
            "nested": 0.1 * size_m[:, 0],
            "same": np.zeros(PAIRS),
            "nearly parallel": rng.normal(0, 1, PAIRS),
            "degenerate": rng.normal(0, 1, PAIRS),
        }[kind]
        other_size_m = size_m * (0.5 if kind == "nested" else 1.0)
        offset_m = np.stack([along_m * np.cos(yaw_rad), along_m * np.sin(yaw_rad), np.zeros(PAIRS)], axis=1)
    if kind == "nearly parallel":
        other_yaw_rad = other_yaw_rad + 10.0 ** rng.uniform(-17, -3, PAIRS)
    if kind == "degenerate":
        other_size_m = other_size_m * rng.integers(0, 2, (PAIRS, 3))
        size_m = size_m * (rng.random((PAIRS, 3)) > 0.1)
    centers_m = position_m.tolist()
    boxes = some_boxes(centers_m, size_m=size_m, yaw_rad=yaw_rad)
    return boxes, some_boxes((position_m + offset_m).tolist(), size_m=other_size_m, yaw_rad=other_yaw_rad)


@pytest.mark.parametrize("kind", ["any", "touching", "nested", "same", "nearly parallel", "degenerate"])
def test_iou_equals_shapely(kind: str) -> None:
    boxes, others = random_pairs(np.random.default_rng(5), kind)
    index = np.arange(PAIRS)
    iou = iou_of_pairs(boxes, others, index, index)
    np.testing.assert_allclose(iou, reference_iou(boxes, others), rtol=0, atol=1e-6)
    assert ((iou >= 0) & (iou <= 1)).all()


def test_iou_by_hand() -> None:
    car = some_boxes([(0, 0, 0)])
    others = some_boxes(
        [(0, 0, 0), (2, 0, 0), (4, 0, 0), (0, 0, 1), (0, 0, 0), (0, 0, 2)],
        yaw_rad=[np.pi, 0, 0, 0, np.pi / 2, 0],
    )
    found = iou_of_pairs(car, others, np.zeros(6, int), np.arange(6))
    np.testing.assert_allclose(found, [1, 1 / 3, 0, 1 / 3, 1 / 3, 0], atol=1e-9)


def test_a_rotation_by_45_degrees_leaves_an_octagon() -> None:
    squares = some_boxes([(7, -3, 2), (7, -3, 2)], size_m=(2, 2, 1), yaw_rad=[0.3, 0.3 + np.pi / 4])
    octagon_m2 = 8 * (np.sqrt(2) - 1)
    found = iou_of_pairs(squares, squares, np.array([0]), np.array([1]))
    assert found == pytest.approx(octagon_m2 / (8 - octagon_m2), abs=1e-9)


def test_aligned_iou_compares_sizes_alone() -> None:
    iou = aligned_iou(np.array([[4.0, 2, 2], [1, 1, 1], [0, 1, 1]]), np.array([[2.0, 4, 2], [1, 1, 1], [0, 1, 1]]))
    np.testing.assert_allclose(iou, [8 / 24, 1, 0])
