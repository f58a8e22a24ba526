"""The evaluator in a running graph rates stacks that answer with the ground truth as perfect."""

import json
import re
import shlex
import sys
from pathlib import Path
from typing import Any

import pytest
from commands import Config, Simbev

from simbev_ros.dataset import open_dataset
from simbev_ros.evaluation.driving.recorded_drives import drives_of

pytestmark = [pytest.mark.graph, pytest.mark.slow]

PARTICIPANT = "evaluation: {participant: echo}"


@pytest.fixture
def lidar_config(small_config: Config) -> Config:
    """Function like ``small_config``, for half a second and the lidar alone, so that fewer processes start."""

    def write(more: str) -> Path:
        path = small_config(0.5, more)
        path.write_text(re.sub(r".*type: (camera|radar|gnss|imu),.*\n", "", path.read_text()))
        return path

    return write


def echo(*options: str) -> str:
    """Command of a stack that answers with the ground truth."""
    return shlex.join([sys.executable, str(Path(__file__).with_name("echo_stack.py")), *options])


def figures_of(file: Path) -> Any:
    return json.loads(file.read_text())


def test_ground_truth_as_answers_is_perfect_in_every_frame(
    simbev: Simbev, lidar_config: Config, tmp_path: Path
) -> None:
    config = lidar_config(PARTICIPANT)
    code, output = simbev("run", config, "--stack", echo("--reports"), "--evaluate", tmp_path / "figures").finish()
    assert code == 0, output
    figures = figures_of(tmp_path / "figures/Blocks-0000.json")
    frames = {"evaluated": 10, "scenes": 1, "answered_boxes": 10, "answered_grids": 10, "missed": 0, "late": 0}
    assert figures["frames"] == {**frames, "without_input": 0, "without_truth": 0, "malformed": 0}
    assert figures["scenes"] == ["Blocks-0000"]
    for method in ("iou", "distance"):
        assert figures["detection"][method]["mAP"] == figures["detection"][method]["SDS"] == 1.0


def test_markers_and_occupancy_grids_of_single_classes_are_perfect(
    simbev: Simbev, lidar_config: Config, tmp_path: Path
) -> None:
    config, file = lidar_config(PARTICIPANT), tmp_path / "figures.json"
    stack = echo("--reports", "--displays")
    code, output = simbev("run", config, "--stack", stack, "--evaluate", file).finish()
    assert code == 0, output
    figures = figures_of(file)
    assert (figures["frames"]["answered_boxes"], figures["frames"]["answered_grids"]) == (10, 10)
    assert figures["frames"]["missed"] == 0
    assert figures["detection"]["iou"]["mAP"] == figures["detection"]["distance"]["mAP"] == 1.0
    assert set(figures["segmentation"]["IoU_at"]) == {"road", "car", "pedestrian"}
    assert set(figures["segmentation"]["mean_IoU_at"].values()) == {1.0}


def test_the_figures_of_a_drive_are_those_of_its_recorded_score(
    simbev: Simbev, lidar_config: Config, tmp_path: Path
) -> None:
    config, file = lidar_config(f"{PARTICIPANT}\ndrive: {{goal_m: 60}}"), tmp_path / "figures.json"
    more = ("--evaluate", file, "--record", tmp_path / "out")
    code, output = simbev("run", config, "--stack", echo("--reports"), *more).finish()
    assert code == 0, output
    (recorded,) = drives_of(open_dataset(tmp_path / "out", threads=1).scenes)
    drives = figures_of(file)["drives"]
    assert drives["scenes"] == {"Blocks-0000": recorded.figures}
    assert drives["scores"] == recorded.figures["scores"]
    assert "Bench2Drive" in output


def test_frames_without_an_answer_are_missed(simbev: Simbev, lidar_config: Config, tmp_path: Path) -> None:
    config, file = lidar_config(PARTICIPANT), tmp_path / "figures.json"
    code, output = simbev("run", config, "--stack", echo("--reports", "--skip", "5"), "--evaluate", file).finish()
    assert code == 0, output
    figures = figures_of(file)
    assert (figures["frames"]["evaluated"], figures["frames"]["missed"]) == (10, 2)
    assert figures["frames"]["answered_boxes"] == figures["frames"]["answered_grids"] == 8
    assert figures["detection"]["iou"]["mAP"] == pytest.approx(0.8, abs=0.05)
    assert figures["segmentation"]["mean_IoU_at"]["0.5"] == pytest.approx(0.8, abs=0.05)


def test_an_answer_without_columns_is_counted_and_the_run_goes_on(
    simbev: Simbev, lidar_config: Config, tmp_path: Path
) -> None:
    config, file = lidar_config(PARTICIPANT), tmp_path / "figures.json"
    code, output = simbev("run", config, "--stack", echo("--reports", "--garble", "4"), "--evaluate", file).finish()
    assert code == 0, output
    frames = figures_of(file)["frames"]
    assert (frames["evaluated"], frames["missed"], frames["malformed"], frames["answered_boxes"]) == (10, 1, 1, 9)
    assert "warning: evaluator: ignored messages on /prediction/boxes: tick 4: " in " ".join(output.split())


def test_a_stack_that_hangs_is_named(simbev: Simbev, lidar_config: Config) -> None:
    config = lidar_config(PARTICIPANT + "\ngraph: {silence_timeout_s: 40}")
    code, output = simbev("run", config, "--stack", echo("--reports", "--hang-at", "3")).finish()
    assert code == 1, output
    assert "error: node echo has been silent for 40 s, after tick 2" in output


def test_a_stack_that_dies_ends_the_run(simbev: Simbev, lidar_config: Config) -> None:
    stack = echo("--reports", "--die-at", "3")
    code, output = simbev("run", lidar_config(PARTICIPANT), "--stack", stack).finish()
    assert code == 1, output
    assert f"error: stack {stack} died after tick 2: exit code 1: out of memory" in output


def test_without_a_stack_the_run_ends_with_a_message(simbev: Simbev, lidar_config: Config, tmp_path: Path) -> None:
    more = "evaluation: {boxes_topic: /boxes, grids_topic: /grids}\ngraph: {silence_timeout_s: 40}"
    code, output = simbev("run", lidar_config(more), "--evaluate", tmp_path / "figures.json").finish()
    assert code == 2, output
    message = "no stack has connected within 32 s: nothing publishes /boxes, /grids or /grids/<class>"
    assert f"error: node evaluator: {message}" in output
