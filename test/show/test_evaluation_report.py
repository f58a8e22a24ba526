"""Tests that an evaluation report is one self-contained page and shows the evaluation's figures."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import evaluated_dataset as made
import numpy as np
import pytest
from html_page import Page

from simbev_ros.dataset import open_dataset
from simbev_ros.evaluation.evaluation import evaluate
from simbev_ros.evaluation.figures import figures_of
from simbev_ros.evaluation.filters import BoxFilter
from simbev_ros.evaluation.metrics import nuscenes
from simbev_ros.evaluation.metrics.boxes import Predictions
from simbev_ros.evaluation.metrics.detection import DetectionOptions
from simbev_ros.evaluation.metrics.nuscenes import NuscenesResult
from simbev_ros.evaluation.options import EvaluationOptions
from simbev_ros.evaluation.predictions.dataset_predictions import open_predictions, write_grid, write_predictions
from simbev_ros.evaluation.slices import GROUPS, TableSlice, table_slices
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.show.pages.charts import Series, share_profile
from simbev_ros.show.reports.evaluation_report import evaluation_report, write_evaluation_report

ERRORS = ("ATE", "AOE", "ASE", "AVE")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.record(tmp_path_factory.mktemp("reported"))


def some_boxes() -> Predictions:
    """Predictions: near cars half a meter off, no far cars, pedestrians twice."""
    own = made.as_predicted(center_m=made.truth().center_m + np.array([0.45, 0.0, 0.0]))
    rows = np.flatnonzero(np.arange(len(own)) % 3 != 1)
    rows = np.sort(np.append(rows, np.arange(2, len(own), 3)))
    return Predictions(own.boxes.take(rows), np.linspace(0.2, 0.9, len(rows)))


def report(
    dataset: Path,
    folder: Path,
    boxes: Predictions | None = None,
    grids: Iterable[int] = (),
    options: EvaluationOptions | None = None,
    scenes: int = 2,
    own_nuscenes: NuscenesResult | None = None,
) -> tuple[Page, dict[str, Any]]:
    """Page and figures of the report for predictions of the first scene."""
    folder.mkdir(exist_ok=True)
    if boxes is not None:
        write_predictions(folder / "boxes.parquet", [(made.NAMES[0], boxes)])
    for tick in grids:
        write_grid(folder, made.NAMES[0], tick, made.scores(0)[:10], BEV_CLASSES[:10])
    chosen, predictions = open_dataset(dataset).scenes[:scenes], open_predictions(folder)
    result = replace(evaluate(chosen, predictions, options), nuscenes=own_nuscenes)
    figures = {"dataset": str(dataset), "predictions": str(folder), **figures_of(result)}
    write_evaluation_report(folder / "report.html", result, chosen, predictions, figures)
    return Page((folder / "report.html").read_text(encoding="utf-8"), is_single=True), figures


@pytest.fixture(scope="module")
def full(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Page, dict[str, Any]]:
    """Page and figures of a report with everything that a report can have."""
    options = EvaluationOptions(tuple(table_slices(TableSlice(maps=("Blocks",)), [*GROUPS])))
    own_nuscenes = random_nuscenes_figures()
    return report(dataset, tmp_path_factory.mktemp("full"), some_boxes(), range(5), options, own_nuscenes=own_nuscenes)


def random_nuscenes_figures() -> NuscenesResult:
    """Random figures, all different, one of them missing."""
    figures = np.random.default_rng(0).random((len(nuscenes.CLASSES), 9))
    figures[8, 5] = np.nan
    truths = np.array([3, 0, 1, 4, 1, 5, 9, 2, 6, 5])
    return NuscenesResult(nuscenes.CLASSES, truths, figures[:, :4], figures[:, 4:])


def texts(values: Iterable[float | None]) -> list[str]:
    return ["–" if value is None else f"{value:.3f}" for value in values]


def test_the_page_has_all_sections_and_shows_the_figures(full: tuple[Page, dict[str, Any]]) -> None:
    page, figures = full
    by = [f"By {name}" for name in GROUPS]
    assert page.headings == [
        *("Boxes", "Bird's-eye view", *by, "nuScenes", "Scenes"),
        *("Frames with the most missed boxes", "Frames with the lowest IoU of cells"),
    ]
    detection, segmentation = figures["detection"], figures["segmentation"]
    for index, (method, name) in enumerate({"iou": "3D IoU", "distance": "distance"}.items()):
        total = detection[method]
        assert page.table("matched by")[name] == texts(total[each] for each in ("mAP", *ERRORS, "SDS"))
        for label, own in detection["classes"].items():
            row = [own[method]["AP"], *own[method]["AP_at"].values()]
            assert page.table("class", index)[label] == [str(own["boxes"]), *texts(row)]
            errors = texts(own[method][each] for each in ERRORS)
            assert page.table("class", 2)[label][4 * index : 4 * index + 4] == errors
    for name, own in segmentation["IoU_at"].items():
        assert page.table("class", 3)[name.replace("_", " ")] == texts(own.values())
    for name, own in figures["nuscenes"]["classes"].items():
        row = [own["AP"], *own["AP_at"].values(), *(own[each] for each in nuscenes.ERRORS)]
        assert page.table("class", 4)[name.replace("_", " ")] == [str(own["boxes"]), *texts(row)]
    for words, own in (("all 10", figures["nuscenes"]), ("the 9 that occur", figures["nuscenes"]["occurring"])):
        errors = texts(own[each] for each in nuscenes.ERRORS)
        assert page.table("class", 4)[words] == ["36", *texts([own["mAP"]]), *[""] * 4, *errors]


def test_tables_by_condition_show_the_figures(full: tuple[Page, dict[str, Any]]) -> None:
    page, figures = full
    detection, segmentation = figures["detection"], figures["segmentation"]
    for group in GROUPS:
        cells = segmentation.get(f"by_{group}")
        for name, own in detection[f"by_{group}"].items():
            totals = texts(own[method][each] for method in ("iou", "distance") for each in ("mAP", "SDS"))
            of_cells = [f"{cells[name]['frames']}", *texts([cells[name]["mean_IoU_at"]["0.5"]])] if cells else []
            assert page.table(group)[name] == [str(own["boxes"]), *totals, *of_cells]


def test_the_scene_table_shows_unanswered_ticks(dataset: Path, tmp_path: Path) -> None:
    boxes = some_boxes()
    page, _ = report(dataset, tmp_path, boxes.take(~np.isin(boxes.boxes.frame, [2, 5, 6, 7])), range(10))
    rows = page.table("scene")
    assert rows["scene"] == [
        *("frames", "with boxes", "with grids", "boxes", "found", "mean IoU"),
        *("ticks without boxes", "ticks without grids"),
    ]
    found = f"{6 * 2 / 30:.3f}"
    assert rows[made.NAMES[0]][:5] == ["10", "6", "10", "30", found] and rows[made.NAMES[0]][6:] == ["2, 5–7", ""]
    assert rows[made.NAMES[1]][:5] == ["10", "0", "0", "30", "0.000"] and rows[made.NAMES[1]][6:] == ["0–9", "0–9"]
    page, _ = report(dataset, tmp_path / "all", boxes, range(10), scenes=1)
    assert "ticks without boxes" not in page.table("scene")["scene"]


def test_boxes_or_cells_alone_have_only_their_sections(dataset: Path, tmp_path: Path) -> None:
    page, _ = report(dataset, tmp_path / "boxes", some_boxes())
    assert page.headings == ["Boxes", "Scenes", "Frames with the most missed boxes"]
    page, _ = report(dataset, tmp_path / "cells", grids=range(3))
    assert page.headings == ["Bird's-eye view", "Scenes", "Frames with the lowest IoU of cells"]


def test_a_missing_figure_is_a_dash(dataset: Path, tmp_path: Path) -> None:
    """No box has the required number of points, and only one matching method is requested."""
    base = TableSlice(boxes=BoxFilter(points=(1000, np.inf)))
    options = EvaluationOptions(tuple(table_slices(base, ["distance"])), DetectionOptions(ious=()))
    page, _ = report(dataset, tmp_path, some_boxes(), options=options)
    assert page.table("matched by") == {
        "matched by": ["mAP", "ATE m", "AOE rad", "ASE", "AVE m/s", "SDS"],
        "distance": ["–"] * 6,
    }
    assert page.table("distance")["0 to 20 m"] == ["0", "–", "–"]
    assert page.headings == ["Boxes", "By distance", "Scenes"]


def test_curves_are_drawn_where_precision_and_recall_are(dataset: Path, tmp_path: Path) -> None:
    """Pedestrians are predicted twice in one of two scenes: precision and recall are 0.5."""
    page, _ = report(dataset, tmp_path, some_boxes(), options=EvaluationOptions(detection=DetectionOptions(ious=())))
    chart = page.charts["Line chart: Pedestrian"]
    assert [(line["x"][-1], line["y"][-1]) for line in chart["data"]] == [(0.5, 0.5)] * 4
    assert (chart["layout"]["xaxis"]["range"], chart["layout"]["yaxis"]["range"]) == ([0.0, 1.03], [0.0, 1.03])


@pytest.mark.parametrize(("joined", "mode"), [(True, "lines+markers"), (False, "markers")])
def test_profiles_have_a_dot_for_each_figure_and_gaps_where_there_is_none(joined: bool, mode: str) -> None:
    cars = Series("car", np.array([1.0, 0.5, np.nan, 0.0]))
    (line,) = share_profile(["near", "mid", "far", "off"], [cars], "AP", joined=joined).data
    assert (line["x"], line["y"], line["mode"]) == (["near", "mid", "far", "off"], [1.0, 0.5, None, 0.0], mode)


def test_names_from_data_are_shown_as_text(dataset: Path, tmp_path: Path) -> None:
    hostile = '<script>alert("&amp;")</script>'
    folder = tmp_path / "<b>"
    folder.mkdir()
    write_predictions(folder / "boxes.parquet", [(made.NAMES[0], some_boxes())])
    scenes, predictions = open_dataset(dataset).scenes, open_predictions(folder)
    result = evaluate(scenes, predictions, None)
    renamed = replace(result, frames={hostile: result.frames[made.NAMES[0]]})
    figures = {"dataset": hostile, "predictions": str(folder), **figures_of(renamed)}
    page = Page(evaluation_report(renamed, figures), is_single=True)
    assert hostile in page.table("scene")
