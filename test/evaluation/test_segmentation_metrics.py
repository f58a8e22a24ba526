"""IoU of bird's-eye-view grids: worked out by hand, and every documented error."""

import numpy as np
import pytest

from simbev_ros.evaluation.figures import segmentation_figures
from simbev_ros.evaluation.metrics.segmentation import THRESHOLDS, SegmentationTally, empty_tally, tallies_by_region
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray

ROAD_AND_CAR = 1 << BEV_CLASSES.index("road") | 1 << BEV_CLASSES.index("car")
ROAD = 1 << BEV_CLASSES.index("road")


def segmentation_tally(labels: AnyArray, scores: AnyArray, classes: tuple[str, ...] = BEV_CLASSES) -> SegmentationTally:
    """Counts of one frame as a whole."""
    (tally,) = tallies_by_region(labels, scores, np.zeros(labels.shape, np.uint8), 1, classes)
    return tally


def test_iou_by_hand() -> None:
    labels = np.array([[ROAD, ROAD_AND_CAR, 0, 0]], np.uint16)
    scores = np.array([[[0.9, 0.4, 0.5, 0.0]], [[0.2, 0.7, 0.65, 0.1]]], np.float32)
    iou = segmentation_tally(labels, scores, ("road", "car")).iou()
    np.testing.assert_allclose(iou[0], [2 / 3, 2 / 3, 2 / 3, 1 / 3, 1 / 2, 1 / 2, 1 / 2, 1 / 2, 0])
    np.testing.assert_allclose(iou[1], [1 / 3, 1 / 2, 1 / 2, 1 / 2, 1 / 2, 1 / 2, 0, 0, 0])


def test_a_sum_of_frames_equals_one_large_frame() -> None:
    rng = np.random.default_rng(6)
    labels = rng.integers(0, 1 << len(BEV_CLASSES), (5, 20, 20), np.uint16)
    scores = rng.random((5, len(BEV_CLASSES), 20, 20))
    total = sum((segmentation_tally(*each) for each in zip(labels, scores, strict=True)), empty_tally())
    assert total.frames == 5
    whole = segmentation_tally(labels.reshape(-1, 20), np.concatenate([*scores], axis=1))
    np.testing.assert_array_equal(total.iou(), whole.iou())
    for row in (0, 13):
        has_class = labels >> row & 1 > 0
        for column, threshold in enumerate(THRESHOLDS):
            above = scores[:, row] > threshold
            assert total.iou()[row, column] == (has_class & above).sum() / (has_class | above).sum()
    mean = segmentation_figures(total, BEV_CLASSES)["mean_IoU_at"]
    np.testing.assert_allclose([*mean.values()], total.iou().mean(axis=0))


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64, np.uint8])
def test_truth_as_prediction_is_perfect(dtype: type) -> None:
    labels = np.random.default_rng(7).integers(0, 1 << len(BEV_CLASSES), (30, 30), np.uint16)
    full = 255 if dtype == np.uint8 else 1
    scores = np.stack([labels >> k & 1 for k in range(len(BEV_CLASSES))]).astype(dtype) * dtype(full)
    assert (segmentation_tally(labels, scores).iou() == 1).all()


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_a_score_exactly_at_a_threshold_is_not_predicted(dtype: type) -> None:
    scores = np.array(THRESHOLDS, dtype).reshape(1, 1, -1)
    predicted = segmentation_tally(np.zeros((1, 9), np.uint16), scores, ("road",)).predicted
    np.testing.assert_array_equal(predicted, [np.arange(8, -1, -1)])


def test_uint8_scores_are_fractions_of_255() -> None:
    scores = np.arange(256, dtype=np.uint8).reshape(1, 16, 16)
    predicted = segmentation_tally(np.zeros((16, 16), np.uint16), scores, ("road",)).predicted
    np.testing.assert_array_equal(predicted, [[256 - each for each in (26, 52, 77, 103, 128, 154, 179, 205, 230)]])


def test_an_absent_class_is_in_no_mean() -> None:
    labels, scores = np.full((2, 2), ROAD, np.uint16), np.zeros((len(BEV_CLASSES), 2, 2))
    scores[0], scores[BEV_CLASSES.index("car"), 0, 0] = 1, 1
    figures = segmentation_figures(segmentation_tally(labels, scores), ("road", "car"))
    assert set(figures["IoU_at"]["car"].values()) == {None}
    assert set(figures["mean_IoU_at"].values()) == {1}
    assert set(segmentation_figures(empty_tally(), BEV_CLASSES)["mean_IoU_at"].values()) == {None}


@pytest.mark.parametrize(
    ("scores", "classes", "message"),
    [
        (np.full((1, 2, 2), np.nan), ("road",), "one is nan; allowed: 0 to 1"),
        (np.full((1, 2, 2), 1.5), ("road",), "one is 1.5; allowed: 0 to 1"),
        (np.zeros((1, 2, 3)), ("road",), r"have the shape \(1, 2, 3\); it must be \(1, 2, 2\)"),
        (np.zeros((1, 2, 2), np.int32), ("road",), "are of the type int32"),
        (np.zeros((1, 2, 2)), ("sea",), "there is no 'sea'"),
    ],
)
def test_bad_scores_are_refused(scores: np.ndarray, classes: tuple[str, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        segmentation_tally(np.zeros((2, 2), np.uint16), scores, classes)
