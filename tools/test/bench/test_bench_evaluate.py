import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from simbev_ros.evaluation.metrics.detection import detection_result
from simbev_ros.evaluation.metrics.scene_matching import Matching
from simbev_ros.foundation.semantics import BOX_CLASSES
from tools.bench import evaluate_timing
from tools.bench.evaluation_load import synthetic_scene


@pytest.fixture
def run(bench: Callable[..., Any]) -> Callable[..., str]:
    """Runs the benchmark of two scenes; gives what it prints."""

    def evaluate(*words: str) -> str:
        answer = bench("evaluate", "--scenes", 2, *words)
        assert answer.code == 0, answer.err
        return str(answer.out)

    return evaluate


@pytest.mark.slow
def test_bench_evaluate_counts_all_boxes_and_says_that_there_is_no_devkit(
    run: Callable[..., str], bench: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(evaluate_timing, "devkit_python", lambda: None)
    timing = json.loads(run("--workers", "1", "--json"))
    assert timing["truths"] == 2 * 320 * 81 and timing["devkit"] is None
    assert 0 < timing["costs"][0]["wall_ms"] < 60e3 and timing["memory_mib"] > 50
    assert "There is no nuscenes-devkit" in "".join(bench("evaluate", "--scenes", 2, "--workers", 2)[1:])


def test_scenes_are_hard_enough_to_mean_something() -> None:
    truth, predictions = synthetic_scene(3, frames=40)
    total = Matching(truth, predictions, np.arange(40)).tally()
    result = detection_result(total)
    assert 0.1 < result.mean_ap("iou") < 0.6 and 0.4 < result.mean_ap("distance") < 0.9
    assert total.truths[BOX_CLASSES.index("pedestrian")] > 1000


@pytest.mark.slow
def test_the_devkit_gets_the_same_score_in_more_time(run: Callable[..., str]) -> None:
    if evaluate_timing.devkit_python() is None:
        pytest.skip("no environment with the devkit; test_nuscenes_devkit.py makes it")
    devkit = json.loads(run("--json"))["devkit"]
    assert devkit["nds_difference"] < 1e-9 and devkit["devkit_s"] > devkit["own_s"]
