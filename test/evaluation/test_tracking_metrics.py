"""Tracking metrics equal those of nuscenes-devkit and TrackEval, and are right where they are known by hand."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_boxes import some_boxes
from made_up_tracks import CLASSES, all_count, as_json, random_scenes, tracked

from simbev_ros.evaluation.figures import _tracking
from simbev_ros.evaluation.metrics.boxes import NO_TRACK, Boxes, Predictions
from simbev_ros.evaluation.metrics.clear_mot import ClearMot, clear_mot
from simbev_ros.evaluation.metrics.hota import hota
from simbev_ros.evaluation.metrics.scene_matching import CountedBoxes
from simbev_ros.evaluation.metrics.tracking import METRICS, TrackingResult, tracking_result
from simbev_ros.evaluation.metrics.tracks import ClassTracks, class_tracks, join_tracks, scene_tracks
from simbev_ros.evaluation.tables import tracking_tables
from simbev_ros.foundation.cache.entries import default_cache_dir
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import BOX_CLASSES

SEEDS, MIN_SCORES = (1, 2), (-1.0, 0.5)
NUMBERS = Path(__file__).parent / "tracking_numbers.json"
"""What both programs say about ``random_scenes``."""
DEVKIT = ("nuscenes-devkit==1.2.0", "motmetrics==1.4.0", "pandas<3")
TRACKEVAL = ("trackeval==1.3.0",)
CAR = BOX_CLASSES.index("car")


def python_with(*requirements: str) -> Path:
    """The Python of an environment with packages, installed once per user."""
    folder = default_cache_dir() / f"{requirements[0].replace('==', '-')}-tracking"
    python, ready = folder / "bin/python", folder / "ready"
    if not ready.exists():
        shutil.rmtree(folder, ignore_errors=True)
        try:
            subprocess.run([sys.executable, "-m", "venv", folder], check=True, capture_output=True)
            subprocess.run([python, "-m", "pip", "install", "-q", *requirements], check=True, capture_output=True)
        except subprocess.CalledProcessError as error:
            pytest.skip(f"{requirements[0]} cannot be installed: {error.stderr.decode()[-300:]}")
        ready.touch()
    return python


def numbers_by(python: Path, program: str, folder: Path, seed: int, *words: str) -> Any:
    """What a program of others says about random scenes."""
    scenes = folder / "scenes.json"
    scenes.write_text(as_json(random_scenes(seed)))
    command = [python, Path(__file__).parent / program, scenes, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr[-2000:]
    return json.loads(done.stdout)


def known_numbers(program: str, seed: int, *words: str) -> Any:
    return json.loads(NUMBERS.read_text())[" ".join((program, str(seed), *words))]


def tracks_of(seed: int, name: str) -> list[ClassTracks]:
    return [class_tracks(all_count(*scene), BOX_CLASSES.index(name)) for scene in random_scenes(seed)]


def assert_equal_nested(found: Any, expected: Any) -> None:
    assert found.keys() == expected.keys()
    for name in expected:
        assert found[name] == pytest.approx(expected[name], abs=1e-9), name


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", CLASSES)
def test_amota_and_mota_are_those_of_the_devkit(seed: int, name: str) -> None:
    expected, found = known_numbers("devkit_tracking.py", seed)[name], clear_mot(tracks_of(seed, name))
    values = found.amota, found.amotp_m, found.mota, found.motp_m, found.recall, found.switches, found.fragmentations
    assert values == pytest.approx([*expected.values()], abs=1e-9)
    assert [*expected] == ["amota", "amotp", "mota", "motp", "recall", "ids", "frag"]
    assert found.switches > 20 and found.fragmentations > 20


@pytest.mark.parametrize("min_score", MIN_SCORES)
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", CLASSES)
def test_hota_is_that_of_trackeval(seed: int, name: str, min_score: float) -> None:
    expected = known_numbers("trackeval_hota.py", seed, str(min_score))[name]
    found = hota([each.above(min_score) for each in tracks_of(seed, name)])
    values = {"HOTA": found.hota, "DetA": found.det_a, "AssA": found.ass_a, "AssPr": found.ass_pr}
    assert {**values, "AssRe": found.ass_re} == pytest.approx(expected, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_the_known_numbers_are_those_of_the_programs(tmp_path: Path, seed: int) -> None:
    program = "devkit_tracking.py"
    for name, each in numbers_by(python_with(*DEVKIT), program, tmp_path, seed).items():
        assert_equal_nested(each, known_numbers(program, seed)[name])
    program = "trackeval_hota.py"
    for min_score in map(str, MIN_SCORES):
        for name, each in numbers_by(python_with(*TRACKEVAL), program, tmp_path, seed, min_score).items():
            assert_equal_nested(each, known_numbers(program, seed, min_score)[name])


def evaluated(truth: Boxes, predicted: Boxes, score: float | np.ndarray = 0.5) -> TrackingResult:
    predictions = Predictions(predicted, np.broadcast_to(score, len(predicted)).astype(np.float64))
    return tracking_result([all_count(truth, predictions)])


def straight(track: int, frames: range, y: float = 0.0) -> list[tuple[int, int, float, float]]:
    """A track that moves along x by 3 m a frame."""
    return [(frame, track, 3.0 * frame, y) for frame in frames]


def test_the_truth_as_prediction_is_perfect() -> None:
    truth = tracked(straight(7, range(10)) + straight(8, range(3, 9), 10.0))
    values = evaluated(truth, truth).classes["car"].values
    expected = {**dict.fromkeys(METRICS, 1.0), "AMOTP": 0.0, "MOTP": 0.0, "IDS": 0, "FRAG": 0, "score": 0.5}
    assert values == pytest.approx(expected)


def test_a_track_that_changes_its_id_halfway() -> None:
    """Ten boxes, all found, the last five by another track: one switch; each match has 5 of 10 boxes in common."""
    truth = tracked(straight(7, range(10)))
    changed = tracked(straight(1, range(5)) + straight(2, range(5, 10)))
    result = evaluated(truth, changed)
    values = result.classes["car"].values
    assert (values["IDS"], values["FRAG"], values["recall"]) == (1, 0, 1)
    assert values["MOTA"] == pytest.approx(0.9)
    assert values["AssA"] == pytest.approx(0.5) and values["AssPr"] == pytest.approx(1) and values["DetA"] == 1
    assert values["HOTA"] == pytest.approx(np.sqrt(0.5))
    assert (result.classes["car"].boxes, result.classes["car"].objects) == (10, 1)


def test_a_gap_is_a_fragmentation_and_a_late_begin_is_none() -> None:
    truth = tracked(straight(7, range(10)))
    values = evaluated(truth, tracked(straight(1, range(2, 5)) + straight(1, range(7, 9)))).classes["car"].values
    assert (values["IDS"], values["FRAG"]) == (0, 1)
    assert values["recall"] == pytest.approx(0.5) and values["MOTA"] == pytest.approx(0.5)
    assert values["AssA"] == pytest.approx(0.5) and values["AssRe"] == pytest.approx(0.5)


def test_distances_give_motp_and_the_similarities_above_which_boxes_match() -> None:
    """At 0.5 m, the similarity is 0.75: 15 of the 19 thresholds, from 0.05 to 0.75, are met."""
    truth = tracked(straight(7, range(10)))
    values = evaluated(truth, tracked(straight(1, range(10), 0.5))).classes["car"].values
    assert values["MOTP"] == values["AMOTP"] == pytest.approx(0.5)
    assert values["HOTA"] == pytest.approx(15 / 19)
    at_limit = evaluated(truth, tracked(straight(1, range(10), 2.0))).classes["car"].values
    assert (at_limit["AMOTA"], at_limit["AMOTP"], at_limit["recall"], at_limit["HOTA"]) == (0, 2, 0, 0)


def test_an_object_keeps_its_track_although_another_one_comes_nearer() -> None:
    """The tracks cross; the assignment at the least distance alone would switch both."""
    truth = tracked([(0, 7, 0, 0), (0, 8, 0, 1.5), (1, 7, 0, 0), (1, 8, 0, 1.5)])
    crossed = tracked([(0, 1, 0, 0), (0, 2, 0, 1.5), (1, 1, 0, 1.0), (1, 2, 0, 0.5)])
    assert evaluated(truth, crossed).classes["car"].values["IDS"] == 0


def test_mota_is_measured_at_its_best_score() -> None:
    """A ghost with a lower score than the found object counts for AMOTA's higher recalls at most."""
    truth = tracked(straight(7, range(10)))
    both = tracked(straight(1, range(10)) + straight(2, range(10), 50.0))
    values = evaluated(truth, both, np.repeat([0.8, 0.3], 10)).classes["car"].values
    assert (values["MOTA"], values["score"], values["HOTA"]) == pytest.approx((1, 0.8, 1))
    certain_ghost = evaluated(truth, both, np.repeat([0.3, 0.8], 10)).classes["car"].values
    assert certain_ghost["MOTA"] == 0 and certain_ghost["DetA"] == pytest.approx(0.5)


def test_classes_have_means_but_counts_have_sums() -> None:
    cars, walker = straight(7, range(10)), straight(9, range(10), 40.0)
    truth = [
        all_count(tracked(cars), Predictions(tracked(straight(1, range(5)) + straight(2, range(5, 10))), np.ones(10)))
    ]
    truth.append(all_count(tracked(walker, "pedestrian"), Predictions(tracked([], "pedestrian"), np.zeros(0))))
    result = tracking_result(truth)
    assert [*result.classes] == ["car", "pedestrian"]
    lost = result.classes["pedestrian"].values
    assert (lost["AMOTA"], lost["AMOTP"], lost["MOTA"], lost["HOTA"]) == (0, 2, 0, 0) and np.isnan(lost["IDS"])
    totals = result.totals()
    assert totals["IDS"] == 1 and totals["MOTA"] == pytest.approx(0.45) and "score" not in totals


def test_tables_have_a_row_per_class_and_the_means() -> None:
    truth = tracked(straight(7, range(10)))
    result = evaluated(truth, tracked(straight(1, range(5)) + straight(2, range(5, 10))))
    first, second = tracking_tables(_tracking(result))  # 35 of 40 recalls are at most 0.9, that without the switch
    assert [cell.value for cell in first.rows[0]] == ["car", 10, 1, 35 / 40, 5 * 2 / 40, 0.9, 0, 1, 1, 0]
    assert first.heads[3:7] == ("AMOTA", "AMOTP m", "MOTA", "MOTP m") and first.rows[1][1:3] == first.rows[0][1:3]
    assert [cell.value for cell in second.rows[1]][:2] == ["mean", None] and second.rows[0][1].value == 0.5


def test_boxes_without_a_track_do_not_count() -> None:
    truth = tracked(straight(7, range(4)))
    some = tracked(straight(1, range(2)) + straight(NO_TRACK, range(2, 4)))
    assert evaluated(truth, some).classes["car"].values["recall"] == pytest.approx(0.5)
    none = Predictions(some_boxes([(0, 0, 0)]), np.ones(1))
    assert len(all_count(truth, none).predictions) == 0


def test_what_finds_an_object_that_does_not_count_is_neither_right_nor_wrong() -> None:
    truth = tracked(straight(7, range(4)) + straight(8, range(4), 20.0))
    ghost = straight(3, range(4), 60.0)
    predicted = Predictions(tracked(straight(1, range(4)) + straight(2, range(4), 20.5) + ghost), np.ones(12))
    counting = CountedBoxes(truth.track == 7, predicted.boxes.track != 3)
    result = tracking_result([scene_tracks(truth, predicted, counting)])
    assert result.classes["car"].boxes == 4
    assert result.classes["car"].values["MOTA"] == result.classes["car"].values["HOTA"] == 1


def test_parts_of_a_scene_equal_the_whole() -> None:
    (truth, predictions), *_ = random_scenes(3, 1)
    parts = [
        all_count(truth.take(mine), predictions.take(theirs))
        for mine, theirs in ((truth.frame // 10 == k, predictions.boxes.frame // 10 == k) for k in range(3))
    ]
    whole = all_count(truth, predictions)
    assert tracking_result([join_tracks(parts)]) == tracking_result([whole])


def test_the_same_track_twice_in_a_frame_is_refused() -> None:
    truth = tracked(straight(7, range(4)))
    with pytest.raises(InputError, match="id: 2 boxes of class car in frame 3 have the id 1"):
        all_count(truth, Predictions(tracked([*straight(1, range(4)), (3, 1, 5.0, 5.0)]), np.ones(5)))


def test_no_predictions_at_a_recall_leave_the_worst_values() -> None:
    empty = class_tracks(all_count(tracked(straight(7, range(4))), Predictions(tracked([]), np.zeros(0))), CAR)
    found = clear_mot([empty])
    assert replace(found, switches=0, fragmentations=0, min_score=0) == ClearMot(0, 2, 0, 2, 0, 0, 0, 0)


if __name__ == "__main__":  # renews the known numbers
    folder, content = Path(sys.argv[1]), {}
    for seed in SEEDS:
        content[f"devkit_tracking.py {seed}"] = numbers_by(python_with(*DEVKIT), "devkit_tracking.py", folder, seed)
        for words in map(str, MIN_SCORES):
            found = numbers_by(python_with(*TRACKEVAL), "trackeval_hota.py", folder, seed, words)
            content[f"trackeval_hota.py {seed} {words}"] = found
    NUMBERS.write_text(json.dumps(content, indent=1) + "\n")
