"""Live and offline evaluation of the same frames give the same metrics; answers, latencies and misses are counted."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_scene import made_up_scene

from simbev_ros.dataset import Scene, open_dataset
from simbev_ros.evaluation.driving.figures import SCORES
from simbev_ros.evaluation.evaluation import evaluation_from_tallies
from simbev_ros.evaluation.figures import figures_of
from simbev_ros.evaluation.live.answer_join import BOXES, LABELS, POSE, JoinCounts, OpenFrame
from simbev_ros.evaluation.live.live_evaluation import LiveEvaluation, live_figures
from simbev_ros.evaluation.metrics.boxes import Predictions, boxes_from_tables
from simbev_ros.evaluation.options import EvaluationOptions
from simbev_ros.evaluation.predictions.dataset_predictions import open_predictions, write_grid, write_predictions
from simbev_ros.evaluation.predictions.predicted_boxes import PredictedBoxes, Reference, join_boxes
from simbev_ros.evaluation.predictions.score_grid import ScoreGrid
from simbev_ros.evaluation.scene_evaluation import evaluate_scene
from simbev_ros.evaluation.slices import TableSlice, table_slices
from simbev_ros.foundation.errors import InputError

TICKS = 80
"""More than the size of a matching batch."""
FRAME = "ego/cam_front"
OPTIONS = EvaluationOptions(slices=tuple(table_slices(TableSlice(), ("distance", "points", "weather"))))


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    path = tmp_path_factory.mktemp("data") / "scenes/train/Blocks-0000"
    made_up_scene(path, ticks=TICKS)
    return open_dataset(path, threads=1).scenes[0]


def answers(scene: Scene, tick: int) -> dict[str, Any]:
    """Answers to most frames: ground truth with errors, and scores of some classes."""
    rng, frame = np.random.default_rng(tick), scene[tick]
    found: dict[str, Any] = {}
    if tick % 7:
        boxes = boxes_from_tables({tick: frame["boxes"]}).take(rng.random(len(frame["boxes"])) < 0.8)
        frame_from_map = np.linalg.inv(frame.map_from_sensor("cam_front"))
        guess_m = boxes.center_m + rng.normal(0, 0.5, boxes.center_m.shape)
        boxes.center_m[:] = guess_m @ frame_from_map[:3, :3].T + frame_from_map[:3, 3]
        found["/boxes"] = PredictedBoxes.with_reference(
            Predictions(boxes, rng.random(len(boxes))), Reference(FRAME, "/boxes")
        )
    for name in ("road", "car") if tick % 5 else ():
        found[f"/bev/{name}"] = ScoreGrid((name,), rng.random((1, *frame["bev/labels"].shape)), f"/bev/{name}")
    return found


def frame_of(scene: Scene, tick: int, **changes: Any) -> OpenFrame:
    frame = scene[tick]
    truth = {POSE: frame.map_from_ego, BOXES: frame["boxes"], LABELS: frame["bev/labels"]}
    return OpenFrame(**{"tick": tick, "truth": truth, "answers": answers(scene, tick), **changes})


def write_answers(scene: Scene, folder: Path) -> Path:
    """Write the same answers as files."""
    found = {tick: answers(scene, tick) for tick in range(TICKS)}
    boxes = [
        (tick, frame_answers["/boxes"].predictions)
        for tick, frame_answers in found.items()
        if "/boxes" in frame_answers
    ]
    predictions = join_boxes(
        [PredictedBoxes.with_reference(each, Reference(FRAME, "")) for _, each in boxes]
    ).predictions
    folder.mkdir()
    content = [(scene.name, predictions, [tick for tick, _ in boxes])]
    write_predictions(folder / "boxes.parquet", content, FRAME, tracks=True)
    for tick, frame_answers in found.items():
        grids = [each for each in frame_answers.values() if isinstance(each, ScoreGrid)]
        if grids:
            scores = np.concatenate([each.scores for each in grids])
            write_grid(folder, scene.name, tick, scores, [name for each in grids for name in each.classes])
    return folder


def assert_matches(found: Any, expected: Any) -> None:
    """Assert that all expected values are there; sums in another order differ in the last digits."""
    if isinstance(expected, dict):
        for name, value in expected.items():
            assert_matches(found[name], value)
    else:
        assert found == (expected if expected is None else pytest.approx(expected, rel=1e-9))


def test_live_figures_equal_those_of_the_recorded_scene(scene: Scene, tmp_path: Path) -> None:
    live = LiveEvaluation(scene.view, OPTIONS)
    for tick in range(TICKS):
        live.add_frame(frame_of(scene, tick))
        if tick % 20 == 5:
            live.running_figures()
    predicted = open_predictions(write_answers(scene, tmp_path / "answers")).scene(scene.name, scene.stamps_ns)
    expected = evaluate_scene(scene, predicted, OPTIONS, grids=True)
    found = live.finish(JoinCounts())
    for name in expected.frames.dtype.names or ():
        assert found.tally.frames[name] == pytest.approx(expected.frames[name], nan_ok=True)
    figures = figures_of(evaluation_from_tallies([expected], OPTIONS))
    assert 0.1 < figures["detection"]["iou"]["SDS"] < 0.9
    assert 0.1 < figures["tracking"]["HOTA"] < 0.9
    assert_matches(live_figures([found], OPTIONS), figures)


def test_running_figures_cover_the_frames_so_far(scene: Scene) -> None:
    live = LiveEvaluation(scene.view, OPTIONS)
    assert live.running_figures() == {"frames": 0, "answered_boxes": 0, "answered_grids": 0}
    for tick in range(10):
        live.add_frame(frame_of(scene, tick))
    running, figures = live.running_figures(), live_figures([live.finish(JoinCounts())], OPTIONS)
    assert (running["frames"], running["answered_boxes"], running["answered_grids"]) == (10, 8, 8)
    assert running["mAP_iou"] == pytest.approx(figures["detection"]["iou"]["mAP"])
    assert running["SDS_distance"] == pytest.approx(figures["detection"]["distance"]["SDS"])
    assert running["mean_IoU"] == pytest.approx(figures["segmentation"]["mean_IoU_at"]["0.5"])
    assert not {name for name in running if name.startswith("latency")}


def test_latency_covers_complete_frames_only(scene: Scene) -> None:
    live = LiveEvaluation(scene.view, OPTIONS)
    for tick in range(12):
        live.add_frame(frame_of(scene, tick, is_complete=tick <= 10, input_s=7.0, answered_s=7.0 + 0.001 * tick))
    latency_ms = live_figures([live.finish(JoinCounts())], OPTIONS)["latency_ms"]
    assert latency_ms == {"p50": pytest.approx(5.0), "p90": pytest.approx(9.0), "p99": pytest.approx(9.9)}


def test_several_scenes_are_counted_together(scene: Scene) -> None:
    scenes = []
    for missed in (1, 2):
        live = LiveEvaluation(scene.view, OPTIONS)
        live.add_frame(frame_of(scene, 1, answers={}))
        scenes.append(live.finish(JoinCounts(missed=missed, late=3)))
    figures = live_figures(scenes, OPTIONS)
    assert (figures["frames"]["missed"], figures["frames"]["late"]) == (3, 6)
    assert figures["latency_ms"] == {"p50": None, "p90": None, "p99": None}
    assert "detection" not in figures
    assert "segmentation" not in figures


def test_drives_of_scenes_that_have_them_are_scored(scene: Scene) -> None:
    live = LiveEvaluation(scene.view, OPTIONS)
    scores = {name: {"driving_score": 40.0} for name in SCORES}
    score = {"ended": "goal", "completed": 0.8, "infractions": {"red_light": 1}, "scores": scores}
    found = live_figures([live.finish(JoinCounts(), score), live.finish(JoinCounts())], OPTIONS)["drives"]
    assert found["scenes"] == {scene.name: score}
    assert (found["drives"], found["infractions"]) == (1, {"red_light": 1})
    assert found["scores"] == scores


def test_boxes_of_an_unknown_frame_are_refused(scene: Scene) -> None:
    live = LiveEvaluation(scene.view, OPTIONS)
    boxes = PredictedBoxes.with_reference(
        answers(scene, 1)["/boxes"].predictions, Reference("base_link", "/boxes: tick 1")
    )
    with pytest.raises(InputError, match=r"^/boxes: tick 1: frame_id: there is no 'base_link' in scene Blocks-0000; "):
        live.add_frame(frame_of(scene, 1, answers={"/boxes": boxes}))
    assert live_figures([live.finish(JoinCounts())], OPTIONS)["frames"]["evaluated"] == 0


def test_grids_of_different_sizes_are_refused(scene: Scene) -> None:
    sizes = {"car": 20, "bus": 9}
    grids = {name: ScoreGrid((name,), np.zeros((1, rows, 24)), f"/bev/{name}") for name, rows in sizes.items()}
    with pytest.raises(InputError, match=r"^/bev/bus: scores: have 9 x 24 cells; the truth has 20 x 24$"):
        LiveEvaluation(scene.view, OPTIONS).add_frame(frame_of(scene, 1, answers=grids))
