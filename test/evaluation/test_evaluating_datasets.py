"""Evaluation from prediction files to tables, worked out by hand on two small scenes."""

from dataclasses import fields, replace
from pathlib import Path

import evaluated_dataset as made
import numpy as np
import pytest
from pydantic import ValidationError

from simbev_ros.config.evaluation import Evaluation as EvaluationSection
from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.parallel import Processes
from simbev_ros.evaluation.evaluation import Evaluation, evaluate
from simbev_ros.evaluation.figures import figures_of
from simbev_ros.evaluation.filters import BoxFilter
from simbev_ros.evaluation.metrics.boxes import Boxes, Predictions
from simbev_ros.evaluation.options import EvaluationOptions, options_of
from simbev_ros.evaluation.predictions.dataset_predictions import open_predictions, write_grid, write_predictions
from simbev_ros.evaluation.slices import TableSlice, table_slices
from simbev_ros.evaluation.tables import condition_table
from simbev_ros.foundation.errors import InputError


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.record(tmp_path_factory.mktemp("evaluated"))


def write_answers(folder: Path, *parts: Predictions, grids: bool = False, frame_id: str = "map") -> Path:
    """Write predictions for the first scenes."""
    write_predictions(folder / "boxes.parquet", list(zip(made.NAMES, parts, strict=False)), frame_id)
    for name in made.NAMES if grids else ():
        for tick in range(made.TICKS):
            write_grid(folder, name, tick, made.scores(tick))
    return folder


def run_evaluation(
    dataset: Path, predictions: Path, options: EvaluationOptions | None = None, workers: int = 1
) -> Evaluation:
    scenes = open_dataset(dataset).scenes
    predictions = open_predictions(predictions).for_dataset([scene.name for scene in scenes])
    return evaluate(scenes, predictions, options, Processes(workers))


def test_truth_as_prediction_is_perfect_in_every_table(dataset: Path, tmp_path: Path) -> None:
    groups = ("distance", "visibility", "points", "difficulty", "daytime", "weather")
    options = EvaluationOptions(tuple(table_slices(TableSlice(), groups)))
    folder = write_answers(tmp_path, made.as_predicted(), made.as_predicted(), grids=True)
    result = run_evaluation(dataset, folder, options)
    rows = [each for each in result.detections.values() if each.truths.sum()]
    assert len(rows) > len(groups)
    for row in rows:
        for method in ("iou", "distance"):
            assert row.mean_ap(method) == pytest.approx(1) and row.sds(method) == pytest.approx(1, abs=1e-6)
    for tally in result.segmentations.values():
        assert np.isin(tally.iou()[~np.isnan(tally.iou())], 1).all()
    frames = np.concatenate([*result.frames.values()])
    assert (frames["found"] == frames["boxes"]).all() and (frames["iou"] == 1).all()


def test_known_errors_come_out_as_they_went_in(dataset: Path, tmp_path: Path) -> None:
    own = made.truth()
    off = made.as_predicted(
        center_m=own.center_m + np.array([0.03, 0.04, 0.0]),
        yaw_rad=own.yaw_rad + 0.01,
        size_m=own.size_m * [1.0, 1.0, 1.25],
        velocity_mps=own.velocity_mps + np.array([3.0, 0.0, 4.0]),
    )
    result = run_evaluation(dataset, write_answers(tmp_path, off, off)).detections[TableSlice()]
    expected = {"ATE": 0.05, "AOE": 0.01, "ASE": 0.2, "AVE": 5.0}
    assert result.mean_errors("distance") == pytest.approx(expected, abs=1e-6)
    assert result.sds("distance") == pytest.approx((4 + 0.95 + 0.99 + 0.8 + 0) / 8, abs=1e-6)


def test_unanswered_frames_are_missed(dataset: Path, tmp_path: Path) -> None:
    """Only the first scene has predictions, and only at even ticks."""
    even = made.as_predicted()
    result = run_evaluation(dataset, write_answers(tmp_path, even.take(even.boxes.frame % 2 == 0)))
    assert result.answered_boxes == {made.NAMES[0]: made.TICKS // 2, made.NAMES[1]: 0}
    assert result.detections[TableSlice()].mean_ap("distance") == pytest.approx(0.25)
    np.testing.assert_array_equal(result.frames[made.NAMES[0]]["found"], [3, 0] * (made.TICKS // 2))
    assert not result.segmentations


def test_frames_without_scores_are_missed(dataset: Path, tmp_path: Path) -> None:
    write_grid(tmp_path, made.NAMES[0], 0, made.scores(0))
    result = run_evaluation(dataset, tmp_path)
    assert not result.detections and result.answered_grids[made.NAMES[0]] == 1
    tally = result.segmentations[TableSlice()]
    assert tally.frames == 2 * made.TICKS
    assert tally.iou()[made.ROAD, 4] == pytest.approx(1 / (2 * made.TICKS))
    assert tally.iou()[made.CAR, 4] == pytest.approx(3 / (2 * made.TICKS * 2.5))


def test_table_rows_count_only_their_own_boxes_and_cells(dataset: Path, tmp_path: Path) -> None:
    options = EvaluationOptions(
        tuple(table_slices(TableSlice(), ("distance", "points", "daytime", "weather"), (0, 20, 40)))
    )
    figures = figures_of(run_evaluation(dataset, write_answers(tmp_path, made.as_predicted(), grids=True), options))
    detection, segmentation = figures["detection"], figures["segmentation"]
    assert {name: row["boxes"] for name, row in detection["by_distance"].items()} == {
        "0 to 20 m": 20,
        "20 to 40 m": 20,
        "40 m and more": 20,
    }
    assert {name: row["boxes"] for name, row in detection["by_points"].items()} == {
        "0 to 1": 20,
        "1 to 5": 20,
        "5 to 20": 0,
        "20 to 100": 20,
        "100 and more": 0,
    }
    assert [row["boxes"] for row in detection["by_daytime"].values()] == [42, 6, 12]
    assert [row["boxes"] for row in detection["by_weather"].values()] == [33, 0, 0, 27]
    assert "by_points" not in segmentation
    assert [row["frames"] for row in segmentation["by_daytime"].values()] == [14, 2, 4]
    assert segmentation["by_distance"]["20 to 40 m"]["IoU_at"]["car"]["0.5"] is None


def test_rows_by_map_are_those_of_the_named_maps(dataset: Path, tmp_path: Path) -> None:
    base = TableSlice(maps=("Blocks", "Elsewhere"))
    options = EvaluationOptions(tuple(table_slices(base, ("map",))))
    figures = figures_of(run_evaluation(dataset, write_answers(tmp_path, made.as_predicted(), grids=True), options))
    assert {name: row["boxes"] for name, row in figures["detection"]["by_map"].items()} == {
        "Blocks": 60,
        "Elsewhere": 0,
    }
    elsewhere = EvaluationOptions((TableSlice(maps=("Elsewhere",)),))
    with pytest.raises(InputError, match="no frame of 2 scenes is left to evaluate"):
        run_evaluation(dataset, tmp_path, elsewhere)


def test_boxes_that_do_not_count_are_ignored(dataset: Path, tmp_path: Path) -> None:
    """The far car is predicted wrongly, and there is also a far false positive."""
    own = made.truth()
    wrong = own.center_m.copy()
    wrong[own.center_m[:, 0] > 60] += (0.0, 30.0, 0.0)
    near = TableSlice(boxes=BoxFilter(range_m=(0, 40)), daytimes=("day",))
    options = EvaluationOptions((near,), box_classes=("car",))
    predicted = made.as_predicted(center_m=wrong)
    result = run_evaluation(dataset, write_answers(tmp_path, predicted, predicted), options)
    assert result.detections[near].truths.sum() == 14
    assert result.detections[near].mean_ap("iou") == pytest.approx(1)
    assert result.frame_count == 14


def test_frames_are_judged_by_as_many_top_predictions_as_boxes(dataset: Path, tmp_path: Path) -> None:
    """A more confident false positive displaces one of two cars; the pedestrian is of another class."""
    own = made.truth()
    near = own.take((own.center_m[:, 0] > 0) & (own.center_m[:, 0] < 20))
    ghosts = replace(near, center_m=near.center_m + np.array([0.0, 30.0, 0.0]))
    columns = (np.concatenate([getattr(own, each.name), getattr(ghosts, each.name)]) for each in fields(Boxes))
    both = Predictions(Boxes(*columns), np.repeat([1.0, 2.0], [len(own), len(ghosts)]))
    result = run_evaluation(dataset, write_answers(tmp_path, both))
    np.testing.assert_array_equal(result.frames[made.NAMES[0]]["found"], [2] * made.TICKS)


def test_tracks_are_measured_where_boxes_have_ids(dataset: Path, tmp_path: Path) -> None:
    assert run_evaluation(dataset, write_answers(tmp_path, made.as_predicted())).trackings == {}
    path = tmp_path / "tracked.parquet"
    write_predictions(path, [(made.NAMES[0], made.as_predicted())], tracks=True)
    result = run_evaluation(dataset, path, EvaluationOptions(box_classes=("car",)))
    figures = figures_of(result)["tracking"]
    found = figures["classes"]["car"]
    assert [*figures["classes"]] == ["car"] and figures["MOTA"] == found["MOTA"]
    assert found["recall"] == pytest.approx(0.5)  # the other scene has no predictions
    assert (found["MOTP"], found["IDS"], found["FRAG"], found["AssA"]) == (0, 0, 0, pytest.approx(1))
    assert found["boxes"] == result.detections[TableSlice()].truths.sum()


def test_tracks_are_measured_by_conditions_of_frames(dataset: Path, tmp_path: Path) -> None:
    """The near car of the second scene has a new track in each of its 4 frames at night, where it rains."""
    own = made.truth()
    is_lost = (own.frame >= 6) & (own.track == 5)
    lost = made.as_predicted(track=np.where(is_lost, 100 + own.frame, own.track))
    path = tmp_path / "tracked.parquet"
    write_predictions(path, list(zip(made.NAMES, (made.as_predicted(), lost), strict=True)), tracks=True)
    base = TableSlice(maps=("Blocks", "Elsewhere"))
    slices = table_slices(base, ("distance", "daytime", "weather", "map"))
    figures = figures_of(run_evaluation(dataset, path, EvaluationOptions(tuple(slices), box_classes=("car",))))
    tracking = figures["tracking"]
    assert "by_distance" not in tracking and tracking["IDS"] == 4
    day, twilight, night = tracking["by_daytime"].values()
    assert [(each["IDS"], each["AMOTA"], each["HOTA"]) for each in (day, twilight)] == [(0, 1, pytest.approx(1))] * 2
    # Of 8 boxes, 3 have another track than the frame before; 4 share their track's only box with 3 others.
    assert (night["IDS"], night["MOTA"]) == (3, pytest.approx(5 / 8))
    assert night["HOTA"] == pytest.approx(((4 * 1 + 4 / 4) / 8) ** 0.5)
    assert tracking["by_map"]["Blocks"]["classes"] == tracking["classes"]
    assert tracking["by_map"]["Elsewhere"]["AMOTA"] is None
    by_daytime = condition_table("daytime", figures)
    assert [*by_daytime.heads[-2:]] == ["AMOTA", "HOTA"]
    assert [[cell.value for cell in row[-2:]] for row in by_daytime.rows] == [
        [each["AMOTA"], each["HOTA"]] for each in (day, twilight, night)
    ]
    assert "AMOTA" not in condition_table("distance", figures).heads


def test_two_files_with_the_same_ids_are_refused(dataset: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_predictions(tmp_path / f"{name}.parquet", [(made.NAMES[0], made.as_predicted())], tracks=True)
    with pytest.raises(InputError, match=rf"^predictions of {made.NAMES[0]}: id: 2 boxes of class .*; files may not"):
        run_evaluation(dataset, tmp_path)


def test_processes_give_the_same_figures(dataset: Path, tmp_path: Path) -> None:
    own = made.truth()
    noisy = made.as_predicted(center_m=own.center_m + np.random.default_rng(1).normal(0, 0.5, own.center_m.shape))
    folder = write_answers(tmp_path, noisy, noisy, grids=True)
    assert figures_of(run_evaluation(dataset, folder)) == figures_of(run_evaluation(dataset, folder, workers=2))


def test_every_nth_frame_is_evaluated(dataset: Path, tmp_path: Path) -> None:
    result = run_evaluation(dataset, write_answers(tmp_path, made.as_predicted()), EvaluationOptions(every=4))
    assert [each["tick"].tolist() for each in result.frames.values()] == [[0, 4, 8]] * 2


def test_scores_of_another_size_are_refused(dataset: Path, tmp_path: Path) -> None:
    write_grid(tmp_path, made.NAMES[0], 3, made.scores(3)[:, :7])
    with pytest.raises(InputError, match=r"000003.npz: scores: have 7 x 20 cells; the truth has 20 x 20"):
        run_evaluation(dataset, tmp_path)


def test_an_evaluation_without_frames_is_refused(dataset: Path, tmp_path: Path) -> None:
    fog = EvaluationOptions((TableSlice(weathers=("fog",)),))
    with pytest.raises(InputError, match="no frame"):
        run_evaluation(dataset, write_answers(tmp_path, made.as_predicted()), fog)


def test_empty_answers_have_zero_ap_and_maximum_errors(dataset: Path, tmp_path: Path) -> None:
    nothing = made.as_predicted()
    folder = tmp_path / "boxes.parquet"
    write_predictions(folder, [(made.NAMES[0], nothing.take(slice(0, 0)), range(made.TICKS))])
    result = run_evaluation(dataset, folder).detections[TableSlice()]
    assert result.mean_ap("iou") == 0 and result.sds("iou") == 0
    assert set(result.mean_errors("iou").values()) == {1.0}


@pytest.mark.parametrize(
    ("groups", "rings", "message"),
    [(["colour"], (0, 20), "by: there is no 'colour'"), (["distance"], (20, 10), "must rise"), ((), (), "must rise")],
)
def test_invalid_tables_are_refused(groups: list[str], rings: tuple[float, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        table_slices(TableSlice(), groups, rings)


def test_unknown_conditions_are_refused() -> None:
    with pytest.raises(InputError, match="weathers: 'snow' is not allowed; allowed: clear, cloudy, fog, rain"):
        TableSlice(weathers=("snow",))
    with pytest.raises(InputError, match="box_classes: there is no 'tram'"):
        EvaluationOptions(box_classes=("tram",))


def test_only_frames_with_truth_are_evaluated(tmp_path: Path) -> None:
    dataset = made.record(tmp_path / "dataset", without="/ego/boxes")
    predictions = write_answers(tmp_path, made.as_predicted(), made.as_predicted())
    with pytest.raises(InputError, match="Blocks-0000: cannot be evaluated, because the bag lacks boxes"):
        run_evaluation(dataset, predictions)
    scene = open_dataset(dataset).scenes[1]
    result = evaluate([scene], open_predictions(predictions))
    assert result.frames[scene.name]["tick"].tolist() == [0, 2, 4, 6, 8]
    assert result.detections[TableSlice()].mean_ap("iou") == pytest.approx(1)


def test_answers_to_frames_whose_pose_was_lost_do_not_count(tmp_path: Path) -> None:
    dataset, ticks = made.record(tmp_path / "dataset", without="/ego/odom"), made.truth().frame
    offset_m = np.array([made.ego_m(tick) for tick in ticks])
    predictions = made.as_predicted(center_m=made.truth().center_m - offset_m)
    predictions = write_answers(tmp_path, predictions, predictions, frame_id="ego/base_link")
    result = evaluate([open_dataset(dataset).scenes[1]], open_predictions(predictions))
    assert result.frame_count == 5
    assert result.detections[TableSlice()].mean_ap("iou") == pytest.approx(1)


def test_nuscenes_metrics_need_the_legend(dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="Blocks-0000: nothing was recorded of world/legend"):
        run_evaluation(dataset, write_answers(tmp_path, made.as_predicted()), EvaluationOptions(nuscenes=True))


def test_options_follow_the_configuration() -> None:
    section = {"range_m": 50, "min_points": 5, "min_visibility": 0.2, "classes": ["car", "road"], "by": ["weather"]}
    options = options_of(EvaluationSection.model_validate(section))
    assert (options.box_classes, options.bev_classes) == (("car",), ("road", "car"))
    base = options.slices[0].boxes
    assert (base.range_m, base.points, base.visibility) == ((0, 50), (5, np.inf), (0.2, np.inf))
    assert {table_slice.group for table_slice in options.slices} == {"", "weather"}
    everything = {"classes": "all", "seen": False}
    assert options_of(EvaluationSection.model_validate(everything)) == EvaluationOptions()
    paper = options_of(EvaluationSection())
    assert paper.box_classes == ("car", "truck", "bus", "motorcycle", "bicycle", "pedestrian")
    assert {*paper.bev_classes} == {*paper.box_classes, "road", "rider"} and paper.slices[0].boxes.seen


@pytest.mark.parametrize(("section", "words"), [({"classes": ["tram"]}, "no 'tram'"), ({"by": ["colour"]}, "distance")])
def test_an_invalid_configuration_is_refused(section: dict[str, list[str]], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        EvaluationSection.model_validate(section)
