"""``simbev evaluate`` as people call it, with good and bad words."""

import json
from pathlib import Path
from typing import Any

import cooperative_scene
import drive_cases
import evaluated_dataset as made
import numpy as np
import pytest
from click.testing import Result
from typer.testing import CliRunner

from simbev_ros.cli.main import app
from simbev_ros.dataset import open_dataset
from simbev_ros.evaluation.driving import recorded_drives
from simbev_ros.evaluation.driving.figures import drive_figures
from simbev_ros.evaluation.driving.recorded_drives import RecordedDrive
from simbev_ros.evaluation.predictions.dataset_predictions import write_grid, write_predictions
from simbev_ros.foundation.errors import InputError

RUNNER = CliRunner()


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.record(tmp_path_factory.mktemp("dataset"))


@pytest.fixture(scope="module")
def predictions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The truth of the first scene."""
    folder = tmp_path_factory.mktemp("predictions")
    write_predictions(folder / "boxes.parquet", [(made.NAMES[0], made.as_predicted())])
    for tick in range(made.TICKS):
        write_grid(folder, made.NAMES[0], tick, made.scores(tick))
    return folder


def called(*words: str | Path) -> Result:
    return RUNNER.invoke(app, ["evaluate", *map(str, words)])


def test_tables_and_figures_say_the_same(dataset: Path, predictions: Path, tmp_path: Path) -> None:
    file = tmp_path / "figures.json"
    result = called(
        predictions, dataset, "--json", file, "--by", "distance,weather", "--scenes", made.NAMES[0], "--workers", "1"
    )
    assert result.exit_code == 0, result.output
    figures = json.loads(file.read_text())
    assert figures["frames"] == {"evaluated": 10, "scenes": 1, "answered_boxes": 10, "answered_grids": 10}
    assert figures["detection"]["iou"]["mAP"] == 1 and figures["segmentation"]["mean_IoU_at"]["0.5"] == 1
    assert set(figures["detection"]["by_weather"]) == {"clear", "cloudy", "fog", "rain"}
    for words in ("10 frames of 1 scene;", "by weather", "average precision by 3D IoU", "< 0.5 m", "pedestrian"):
        assert words in result.stdout


def test_swapped_arguments_are_named(dataset: Path, predictions: Path, tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    for given in (predictions, predictions / "boxes.parquet", empty):
        result = called(dataset, given)
        assert str(result.exception) == f"{given}: is not a dataset, but {dataset} is; they seem to be swapped"
    assert "swapped" not in str(called(predictions / "boxes.parquet", predictions / "boxes.parquet").exception)


def test_figures_are_written_although_nobody_reads_the_tables(
    dataset: Path, predictions: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(*_: object) -> None:
        raise BrokenPipeError

    monkeypatch.setattr("simbev_ros.cli.evaluate.tables.print_tables", gone)
    called(predictions, dataset, "--json", tmp_path / "figures.json", "--workers", "1")
    assert json.loads((tmp_path / "figures.json").read_text())["frames"]["evaluated"] == 20


def test_the_figures_are_of_what_is_asked_for(dataset: Path, predictions: Path, tmp_path: Path) -> None:
    file = tmp_path / "figures.json"
    config = tmp_path / "config.yaml"
    config.write_text("evaluation: {distances_m: [], range_m: 50, classes: [car], by: [map]}\n")
    words = ("--config", config, "--range", ":40", "--points", "1", "--every", "2", "--by", "")
    result = called(predictions, dataset, "--json", file, *words)
    assert result.exit_code == 0, result.output
    figures = json.loads(file.read_text())
    assert figures["frames"]["evaluated"] == 10 and set(figures["detection"]["classes"]) == {"car"}
    assert figures["detection"]["boxes"] == 10 and "distance" not in figures["detection"]
    assert figures["detection"]["iou"]["mAP"] == pytest.approx(0.5)
    assert list(figures["segmentation"]["IoU_at"]) == ["car"]
    assert not [key for key in figures["detection"] if key.startswith("by_")]


def test_rings_of_distance_have_the_limits_that_are_given(dataset: Path, predictions: Path, tmp_path: Path) -> None:
    counts = {}
    for by in ("distance:15,42.5,map", "map,distance"):
        result = called(predictions, dataset, "--all", "--by", by, "--json", tmp_path / "figures.json")
        assert result.exit_code == 0, result.output
        figures = json.loads((tmp_path / "figures.json").read_text())["detection"]
        counts[by] = {name: row["boxes"] for name, row in figures["by_distance"].items()}
        assert sum(counts[by].values()) == figures["boxes"] and figures["by_map"]
    own, usual = counts.values()
    assert list(own) == ["0 to 15 m", "15 to 42.5 m", "42.5 m and more"]
    assert list(usual) == ["0 to 20 m", "20 to 40 m", "40 to 60 m", "60 m and more"]
    distances_m = np.concatenate([frame["boxes"]["distance"] for frame in open_dataset(dataset).frames()])
    assert list(own.values()) == np.histogram(distances_m, [0, 15, 42.5, np.inf])[0].tolist()


def test_boxes_that_nothing_sees_and_other_classes_count_only_with_all(
    dataset: Path, predictions: Path, tmp_path: Path
) -> None:
    def detection(*words: str) -> tuple[dict[str, Any], str]:
        file = tmp_path / "figures.json"
        result = called(predictions, dataset, "--scenes", made.NAMES[0], "--json", file, *words)
        assert result.exit_code == 0, result.output
        return json.loads(file.read_text())["detection"], result.stdout

    figures, shown = detection()
    assert figures["boxes"] == 20 and figures["left_out"] == {"of_other_classes": 0, "unseen": 10}
    assert "boxes that do not count: 10 without a point that no camera sees" in shown
    figures, _ = detection("--classes", "pedestrian")
    assert figures["boxes"] == 10 and figures["left_out"] == {"of_other_classes": 20, "unseen": 0}
    figures, shown = detection("--all")
    assert figures["boxes"] == 30 and "do not count" not in shown


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--classes", "tram"), "classes: there is no 'tram'; allowed: car, "),
        (("--range", "50"), "--range: '50': must be FROM:TO"),
        (("--range", "50:20"), "range: range_m: 20 must be above min_range_m, 50"),
        (("--range", "a:"), "--range: 'a' is not a number"),
        (("--by", "distance,,map"), "must be words with commas between"),
        (("--by", "colour"), "by: Input should be 'distance', "),
        (("--by", "distance:40,20"), "by: 0, 40, 20: must rise, the first from 0 or more"),
        (("--by", "distance:near"), "--by: 'near' is not a number"),
        (("--by", "map,20"), "by: Input should be 'distance', "),
        (("--by", "weather:20"), "by: Input should be 'distance', "),
        (("--scenes", "Blocks-0009"), "has no scene 'Blocks-0009', but Blocks-0000, Blocks-0001"),
        (("--split", "train"), "there is no scene of the split 'train'"),
        (("--json", "/nowhere/a.json"), "/nowhere/a.json: there is no folder /nowhere"),
        (("--report", "/tmp"), "/tmp: is a folder, not a file"),
        (("--json", "/proc/a.json"), "/proc: cannot be written to"),
        (("--config", "none.yaml"), "none.yaml: no such file; shipped configurations are "),
    ],
)
def test_bad_words_are_named(dataset: Path, predictions: Path, words: tuple[str, ...], message: str) -> None:
    result = called(predictions, dataset, *words)
    assert isinstance(result.exception, InputError)
    assert message in str(result.exception)


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ("rings_m: [20, 10]", ":1: evaluation.rings_m: 20, 10: must rise"),
        ("ious: [0.5, 1.5]", ":1: evaluation.ious.1: Input should be less than or equal to 1, not 1.5"),
        ("ious: [], distances_m: []", ":1: evaluation.ious, distances_m: at least one threshold is needed"),
        ("weathers: [snow]", ":1: evaluation.weathers.0: Input should be 'clear', "),
        ("difficulties: []", ":1: evaluation.difficulties: "),
        ("daytimes: [night]", "no frame of 1 scenes is left to evaluate"),
        (None, ": has no section evaluation"),
    ],
)
def test_a_wrong_section_of_the_configuration_is_named(
    dataset: Path, predictions: Path, tmp_path: Path, section: str | None, message: str
) -> None:
    config = tmp_path / "config.yaml"
    config.write_text("seed: 1\n" if section is None else f"evaluation: {{{section}}}\n")
    result = called(predictions, dataset, "--config", config, "--scenes", made.NAMES[0])
    assert isinstance(result.exception, InputError)
    assert message in str(result.exception)


def test_a_shipped_configuration_says_what_counts(dataset: Path, predictions: Path, tmp_path: Path) -> None:
    file = tmp_path / "figures.json"
    result = called(predictions, dataset, "--config", "stack", "--json", file, "--workers", "1")
    assert result.exit_code == 0, result.output
    assert "motorcycle" in json.loads(file.read_text())["segmentation"]["IoU_at"]


def test_predictions_of_another_dataset_are_refused(dataset: Path, tmp_path: Path) -> None:
    write_predictions(tmp_path / "boxes.parquet", [("Town03-0007", made.as_predicted())])
    result = called(tmp_path, dataset)
    assert isinstance(result.exception, InputError)
    assert "there is no 'Town03-0007'; the dataset has Blocks-0000, Blocks-0001" in str(result.exception)


def test_one_of_several_agents_is_judged_by_what_all_of_them_see(tmp_path: Path) -> None:
    cars, file, figures_file = (
        cooperative_scene.record(tmp_path / "cars"),
        tmp_path / "car.parquet",
        tmp_path / "f.json",
    )
    seen = {tick: cooperative_scene.seen("car", tick) for tick in range(cooperative_scene.TICKS)}
    write_predictions(file, [(cooperative_scene.NAME, cooperative_scene.as_answers(seen))])
    words = (file, cars, "--agent", "car", "--points", "1", "--json", figures_file, "--workers", "1", "--by", "")
    for truth, boxes, precision in (("own", 3, 1.0), ("joint", 4, 0.75)):
        result = called(*words, "--truth", truth, "--report", tmp_path / "report.html")
        assert result.exit_code == 0, result.output
        figures = json.loads(figures_file.read_text())
        assert (figures["agent"], figures["truth"]) == ("car", truth)
        assert figures["detection"]["boxes"] == boxes * cooperative_scene.TICKS
        assert figures["detection"]["iou"]["mAP"] == pytest.approx(precision, abs=0.01)
    assert "figures in" in result.stdout and (tmp_path / "report.html").stat().st_size > 10_000


def test_a_bag_has_the_answers_of_an_agent_below_its_name(tmp_path: Path) -> None:
    cars = cooperative_scene.record(tmp_path / "cars")
    for agent, topic in (("car", "/car/prediction/boxes"), ("ego", "/prediction/boxes")):
        assert f"there is no topic {topic}," in str(called(cars, cars, "--agent", agent).exception)
    assert "--agent 'bus': " in str(called(cars, cars, "--agent", "bus").exception)


def test_scores_of_drives_come_with_those_of_predictions(
    predictions: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive = drive_cases.spec().drive
    monkeypatch.setattr(made, "spec", lambda number, own=made.spec: own(number).model_copy(update={"drive": drive}))
    driven, file, page = made.record(tmp_path / "driven"), tmp_path / "figures.json", tmp_path / "report.html"
    record = drive_cases.drive(drive_cases.straight(10.0), 3.0)[0].record
    judged = [RecordedDrive(name, drive_figures(record), record.infractions) for name in made.NAMES]
    monkeypatch.setattr(recorded_drives, "drives_of", lambda scenes: judged[: len(scenes)])
    result = called(predictions, driven, "--json", file, "--report", page, "--workers", "1")
    assert result.exit_code == 0, result.output
    figures = json.loads(file.read_text())
    assert figures["frames"]["evaluated"] == 20 and figures["drives"]["drives"] == 2
    assert set(figures["drives"]["scenes"]) == {*made.NAMES}
    assert "CARLA 2.1" in result.stdout and "<h2>Drives</h2>" in page.read_text()
