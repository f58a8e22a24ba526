"""Detection metrics: worked out by hand, compared with sequential matching, and in undefined cases."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_boxes import random_predictions, random_truth, some_boxes

from simbev_ros.evaluation.metrics.boxes import Boxes, Predictions, empty_boxes
from simbev_ros.evaluation.metrics.detection import (
    DetectionOptions,
    DetectionResult,
    detection_result,
    merge_tallies,
    precision_recall,
)
from simbev_ros.evaluation.metrics.overlap import iou_of_pairs
from simbev_ros.evaluation.metrics.scene_matching import CountedBoxes, Matching
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import BOX_CLASSES

CAR, TRUCK = BOX_CLASSES.index("car"), BOX_CLASSES.index("truck")
FRAME = np.array([0])
NOTHING = Predictions(empty_boxes(), np.zeros(0))


def with_scores(boxes: Boxes, *scores: float) -> Predictions:
    return Predictions(boxes, np.array(scores))


def compute_metrics(truth: Boxes, predictions: Predictions, options: DetectionOptions | None = None) -> DetectionResult:
    return detection_result(Matching(truth, predictions, FRAME, options).tally(), options)


def test_truth_as_prediction_is_perfect() -> None:
    truth = random_truth(np.random.default_rng(1), frames=20, per_frame=40)
    result = detection_result(Matching(truth, Predictions(truth, np.ones(len(truth))), np.arange(20)).tally())
    np.testing.assert_allclose(result.ap, 1.0)
    np.testing.assert_allclose(result.errors, 0.0, atol=1e-12)
    for method in ("iou", "distance"):
        assert result.mean_ap(method) == result.sds(method) == pytest.approx(1.0)


def test_average_precision_by_hand() -> None:
    """Four cars, hits at ranks 1, 3 and 4 of five: precision 1, 2/3, 3/4 at recalls 1/4, 1/2, 3/4."""
    truth = some_boxes([(0, 0, 0), (10, 0, 0), (20, 0, 0), (30, 0, 0)])
    found = some_boxes([(0.2, 0, 0), (90, 0, 0), (10, 0, 0), (20, 0, 0), (80, 0, 0)])
    predictions = with_scores(found, 0.9, 0.8, 0.7, 0.6, 0.5)
    steps = compute_metrics(truth, predictions)
    np.testing.assert_allclose(steps.ap[CAR], (1 + 2 / 3 + 3 / 4) / 4)
    envelope = compute_metrics(truth, predictions, DetectionOptions(area="envelope"))
    np.testing.assert_allclose(envelope.ap[CAR], (1 + 3 / 4 + 3 / 4) / 4)
    curve = precision_recall(Matching(truth, predictions, FRAME).tally(), CAR, 0)
    np.testing.assert_allclose(curve.precision, [1, 1 / 2, 2 / 3, 3 / 4, 3 / 5])
    np.testing.assert_allclose(curve.recall, [1 / 4, 1 / 4, 1 / 2, 3 / 4, 3 / 4])


def test_predictions_with_equal_scores_form_one_point() -> None:
    truth = some_boxes([(0, 0, 0)])
    for centers_m in ([(0, 0, 0), (50, 0, 0)], [(50, 0, 0), (0, 0, 0)]):
        assert compute_metrics(truth, with_scores(some_boxes(centers_m), 0.5, 0.5)).mean_ap("distance") == 0.5


def test_errors_and_score_by_hand() -> None:
    """A car 0.75 m ahead and 1 m up, turned by 0.1 rad past a full turn, half as long, 1 m/s too fast on each axis."""
    truth = some_boxes([(5, 5, 0)], yaw_rad=np.pi, velocity_mps=(3, 0, 0))
    found = with_scores(some_boxes([(5.75, 5, 1)], yaw_rad=-np.pi + 0.1, size_m=(2, 2, 2), velocity_mps=(4, 1, 1)), 1.0)
    result = compute_metrics(truth, found)
    # 1.25 m apart it is a hit at 2 and 4 m; at 0.5 and 1 m, errors are 1.
    np.testing.assert_allclose(result.ap[CAR, result.columns("distance")], [0, 0, 1, 1])
    means = {"ATE": (1 + 1.25) / 2, "AOE": (1 + 0.1) / 2, "ASE": (1 + 0.5) / 2, "AVE": (1 + 3**0.5) / 2}
    assert result.mean_errors("distance") == pytest.approx(means)
    assert result.sds("distance") == pytest.approx((4 * 0.5 + 0 + 0.45 + 0.25 + 0) / 8)
    planar = compute_metrics(truth, found, DetectionOptions(planar=True)).mean_errors("distance")
    assert planar["ATE"] == pytest.approx((1 + 3 * 0.75) / 4)
    assert planar["AVE"] == pytest.approx((1 + 3 * 2**0.5) / 4)


def test_a_prediction_exactly_at_a_threshold_is_no_hit() -> None:
    result = compute_metrics(some_boxes([(0, 0, 0)]), with_scores(some_boxes([(0.5, 0, 0)]), 1.0))
    np.testing.assert_allclose(result.ap[CAR, result.columns("distance")], [0, 1, 1, 1])


def test_iou_thresholds_by_hand() -> None:
    """Shifted by a fifth of its length, a box overlaps by 0.8 / 1.2 = 2/3."""
    result = compute_metrics(some_boxes([(0, 0, 0)]), with_scores(some_boxes([(0.8, 0, 0)]), 1.0))
    np.testing.assert_allclose(result.ap[CAR, result.columns("iou")], [1, 1, 1, 1, 0, 0, 0])
    assert result.mean_ap("iou") == pytest.approx(4 / 7)
    assert result.mean_errors("iou")["ATE"] == pytest.approx((4 * 0.8 + 3) / 7)


def test_known_noise_gives_its_errors() -> None:
    rng = np.random.default_rng(2)
    truth = some_boxes([(20 * k, 0, 0) for k in range(4000)])
    offset_m = rng.normal(0, 0.05, (4000, 3))
    noisy = replace(truth, center_m=truth.center_m + offset_m, yaw_rad=rng.normal(0, 0.1, 4000))
    errors = compute_metrics(truth, with_scores(noisy, *np.ones(4000))).mean_errors("distance")
    # Mean of a Maxwell and of a half-normal distribution.
    assert errors["ATE"] == pytest.approx(0.05 * np.sqrt(8 / np.pi), rel=0.03)
    assert errors["AOE"] == pytest.approx(0.1 * np.sqrt(2 / np.pi), rel=0.03)


def greedy_outcomes(truth: Boxes, predictions: Predictions) -> np.ndarray:
    """Outcome of each prediction at each threshold, matched one by one as in the definition."""
    options, predicted = DetectionOptions(), predictions.boxes
    same = (predicted.frame[:, None] == truth.frame) & (predicted.label[:, None] == truth.label)
    distance_m = np.linalg.norm(predicted.center_m[:, None] - truth.center_m, axis=-1)
    iou = iou_of_pairs(predicted, truth, *np.indices(same.shape).reshape(2, -1)).reshape(same.shape)
    costs = {"iou": -iou, "distance": distance_m}
    outcome = np.zeros((len(predicted), len(options.thresholds)), int)
    for column, (method, threshold) in enumerate(options.thresholds):
        cost = np.where(same, costs[method], np.inf)
        for row in np.argsort(predictions.score, kind="stable")[::-1]:
            best = cost[row].argmin()
            if cost[row, best] < (-threshold if method == "iou" else threshold):
                outcome[row, column], cost[:, best] = 1, np.inf
    return outcome


def test_matching_equals_sequential_greedy_matching() -> None:
    rng = np.random.default_rng(3)
    truth = random_truth(rng, frames=2, per_frame=150)
    truth = replace(truth, label=truth.label % 2, size_m=truth.size_m + 2)
    predictions = random_predictions(rng, truth, noise=0.1)
    outcome = Matching(truth, predictions, np.arange(2)).tally().outcome
    expected = greedy_outcomes(truth, predictions)
    assert (expected.mean(axis=0) > 0.1).all() and (expected.mean(axis=0) < 0.9).all()
    np.testing.assert_array_equal(outcome, expected)


def test_merged_parts_equal_the_whole() -> None:
    rng = np.random.default_rng(4)
    truth = random_truth(rng, frames=9, per_frame=50)
    predictions = random_predictions(rng, truth)
    parts = [
        Matching(
            truth.take(truth.frame // 3 == part), predictions.take(predictions.boxes.frame // 3 == part), frames
        ).tally()
        for part, frames in enumerate(np.arange(9).reshape(3, 3))
    ]
    whole = detection_result(Matching(truth, predictions, np.arange(9)).tally())
    for order in (parts, parts[::-1]):
        merged = detection_result(merge_tallies(order))
        np.testing.assert_allclose(merged.ap, whole.ap, rtol=1e-12)
        np.testing.assert_allclose(merged.errors, whole.errors, rtol=1e-12)


def test_frames_may_be_stamps() -> None:
    rng = np.random.default_rng(8)
    truth = random_truth(rng, frames=5, per_frame=50)
    predictions = random_predictions(rng, truth)
    stamps_ns = 1_760_000_000_000_000_000 + 50_000_000 * np.arange(5)
    stamped = Predictions(replace(predictions.boxes, frame=stamps_ns[predictions.boxes.frame]), predictions.score)
    outcome = Matching(replace(truth, frame=stamps_ns[truth.frame]), stamped, stamps_ns).tally().outcome
    np.testing.assert_array_equal(outcome, Matching(truth, predictions, np.arange(5)).tally().outcome)


def test_without_predictions_all_is_missed() -> None:
    result = compute_metrics(some_boxes([(0, 0, 0)]), NOTHING)
    assert result.sds("iou") == result.mean_ap("iou") == 0.0
    assert result.mean_errors("iou") == dict.fromkeys(("ATE", "AOE", "ASE", "AVE"), 1.0)


def test_a_class_without_truth_is_in_no_mean() -> None:
    truth = some_boxes([(0, 0, 0)])
    found = some_boxes([(0, 0, 0), (9, 0, 0)], label=[CAR, TRUCK])
    result = compute_metrics(truth, with_scores(found, 1.0, 1.0))
    assert np.isnan(result.ap[TRUCK]).all() and np.isnan(result.errors[TRUCK]).all()
    assert result.sds("iou") == pytest.approx(1.0)


def test_without_any_truth_nothing_is_defined() -> None:
    result = compute_metrics(empty_boxes(), with_scores(some_boxes([(0, 0, 0)]), 1.0))
    assert np.isnan(result.mean_ap("iou")) and np.isnan(result.sds("distance"))


def test_unknown_velocities_are_ignored() -> None:
    truth = some_boxes([(0, 0, 0), (9, 0, 0)])
    found = some_boxes([(0, 0, 0), (9, 0, 0)], velocity_mps=[(0.5, 0, 0), (np.nan,) * 3])
    assert compute_metrics(truth, with_scores(found, 1.0, 1.0)).mean_errors("iou")["AVE"] == pytest.approx(0.5)


def test_boxes_that_do_not_count_are_neither_right_nor_wrong() -> None:
    """A car that counts, one that does not, found twice, and two false positives, one of which does not count."""
    truth = some_boxes([(0, 0, 0), (20, 0, 0)])
    found = with_scores(
        some_boxes([(20, 0, 0), (20.1, 0, 0), (0, 0, 0), (50, 0, 0), (70, 0, 0)]), 0.9, 0.8, 0.7, 0.6, 0.5
    )
    counting = CountedBoxes(np.array([True, False]), np.array([True, True, True, True, False]))
    part = Matching(truth, found, FRAME).tally(counting)
    np.testing.assert_array_equal(part.outcome[:, 0], [0, 1, 0])
    np.testing.assert_array_equal(part.score, [0.8, 0.7, 0.6])
    assert part.truths[CAR] == 1
    np.testing.assert_allclose(detection_result(part).ap[CAR], 1 / 2)


def test_far_and_huge_predictions_are_harmless() -> None:
    truth = some_boxes([(0, 0, 0), (100, 0, 0)], label=[CAR, TRUCK])
    found = some_boxes(
        [(0, 0, 0), (1e15, 0, 0), (0, 0, 0)], label=[CAR, CAR, TRUCK], size_m=[(4, 2, 2), (4, 2, 2), (1e15, 1, 1)]
    )
    part = Matching(truth, with_scores(found, 0.9, 0.8, 0.7), FRAME).tally()
    np.testing.assert_array_equal(part.outcome, np.outer([1, 0, 0], np.ones(11)))


def test_a_score_that_is_not_a_number_is_refused() -> None:
    with pytest.raises(InputError, match="boxes: score: row 1 is nan; it must be finite"):
        with_scores(some_boxes([(0, 0, 0), (1, 0, 0)]), 0.5, np.nan)


def test_matching_needs_a_threshold() -> None:
    with pytest.raises(InputError, match="thresholds: there is none, neither of 3D IoU nor of distance"):
        DetectionOptions(ious=(), distances_m=())


def test_predictions_of_another_scene_are_refused() -> None:
    unknown = with_scores(some_boxes([(0, 0, 0)], frame=321), 0.5)
    with pytest.raises(InputError, match="predictions: frame: 321 is not in this scene, which has 320 frames, from 1 "):
        Matching(empty_boxes(), unknown, np.arange(1, 321)).tally()


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"size_m": (1, -1, 1)}, "size_m: row 0 is -1.0; it must be not negative"),
        ({"yaw_rad": np.nan}, "yaw_rad: row 0 is nan; it must be finite"),
        ({"label": 99}, "label: row 0 is 99; it must be below 10"),
        ({"velocity_mps": np.inf}, "velocity_mps: row 0 is inf; it must be finite, or NaN where unknown"),
    ],
)
def test_impossible_boxes_are_refused(columns: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        some_boxes([(0, 0, 0)], **columns)
