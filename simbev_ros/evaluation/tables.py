"""Tables of an evaluation as data: titles, headings and typed cells, independent of how they are drawn.

They are made from the values of ``evaluation.figures.figures_of``. The command line and the HTML report draw them.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

from simbev_ros.evaluation.figures import METHODS
from simbev_ros.evaluation.metrics.errors import ERRORS
from simbev_ros.evaluation.metrics.segmentation import TABLE_THRESHOLD
from simbev_ros.evaluation.metrics.tracking import COUNTS

METHOD_NAMES: Mapping[str, str] = {"iou": "3D IoU", "distance": "distance"}
"""Display name of each matching method."""
_UNITS: Mapping[str, str] = {"ATE": " m", "AOE": " rad", "AVE": " m/s"}
_TRACK_UNITS: Mapping[str, str] = {"AMOTP": " m", "MOTP": " m"}
_TRACK_COUNTS = ("boxes", "objects", *COUNTS)
_TRACK_TABLES: Mapping[str, Sequence[str]] = {
    "tracks": ("boxes", "objects", "AMOTA", "AMOTP", "MOTA", "MOTP", "recall", "IDS", "FRAG"),
    "tracks by HOTA": ("score", "HOTA", "DetA", "AssA", "AssPr", "AssRe"),
}
"""Columns of the tables of tracking metrics, by title."""
_TRACK_SCORES: Sequence[str] = ("AMOTA", "HOTA")
"""Tracking metrics in the tables by condition."""
ERROR_HEADS: Sequence[str] = [f"{name}{_UNITS.get(name, '')}" for name in ERRORS]
"""Headings of the errors of ``metrics.errors.ERRORS``, with their units."""

Figures = Mapping[str, Any]
"""The values of ``evaluation.figures.figures_of``, or a part of them."""


class CellKind(Enum):
    """Kind of value in a cell, which decides how it is drawn."""

    NAME = "name"
    COUNT = "count"
    SHARE = "share"  # 0 … 1, more is better
    NUMBER = "number"


class Cell(NamedTuple):
    """Typed value in a table; None if it is undefined."""

    kind: CellKind
    value: str | float | None


@dataclass(frozen=True, slots=True)
class FigureTable:
    """Table of an evaluation, ready to be drawn.

    Attributes:
        title: Heading above the table.
        heads: Heading of each column.
        rows: Cells of each row, one per column.
    """

    title: str
    heads: Sequence[str]
    rows: Sequence[Sequence[Cell]]


def evaluation_tables(figures: Figures) -> Iterator[FigureTable]:
    """All tables of an evaluation, in reading order."""
    if detection := figures.get("detection"):
        yield summary_table(detection)
        for method in measured_methods([detection]):
            yield precision_table(detection, method)
        yield error_table(detection)
    if tracking := figures.get("tracking"):
        yield from tracking_tables(tracking)
    if segmentation := figures.get("segmentation"):
        yield segmentation_table(segmentation)
    for condition in conditions_of(figures):
        yield condition_table(condition, figures)
    if nuscenes := figures.get("nuscenes"):
        yield nuscenes_table(nuscenes)


def summary_table(detection: Figures) -> FigureTable:
    """Table with a row per matching method: mAP, mean errors, SDS."""
    rows = [
        [
            _name_cell(METHOD_NAMES[method]),
            _share_cell(detection[method]["mAP"]),
            *_number_cells(detection[method][error] for error in ERRORS),
            _share_cell(detection[method]["SDS"]),
        ]
        for method in measured_methods([detection])
    ]
    return FigureTable("boxes", ("matched by", "mAP", *ERROR_HEADS, "SDS"), rows)


def precision_table(detection: Figures, method: str) -> FigureTable:
    """Table with a row per class: number of boxes, AP, and AP at each threshold."""
    classes = detection["classes"]
    thresholds = list(next(iter(classes.values()))[method]["AP_at"]) if classes else []
    signed = [f"> {each}" if method == "iou" else f"< {each} m" for each in thresholds]
    rows = [
        [
            _name_cell(name),
            _count_cell(values["boxes"]),
            _share_cell(values[method]["AP"]),
            *_share_cells(values[method]["AP_at"].values()),
        ]
        for name, values in classes.items()
    ]
    return FigureTable(f"average precision by {METHOD_NAMES[method]}", ("class", "boxes", "AP", *signed), rows)


def error_table(detection: Figures) -> FigureTable:
    """Table with a row per class: errors averaged over the thresholds, for each matching method."""
    methods = measured_methods([detection])
    rows = [
        [_name_cell(name), *_number_cells(values[method][error] for method in methods for error in ERRORS)]
        for name, values in detection["classes"].items()
    ]
    title = f"errors, matched by {' and by '.join(METHOD_NAMES[method] for method in methods)}"
    return FigureTable(title, ("class", *(list(ERROR_HEADS) * len(methods))), rows)


def tracking_tables(tracking: Figures) -> Iterator[FigureTable]:
    """Tables with a row per class: tracking metrics; the last row has their means, and the sums of counts."""
    classes = tracking["classes"]
    total = {each: sum(row[each] for row in classes.values()) for each in ("boxes", "objects")}
    for title, names in _TRACK_TABLES.items():
        heads = ("class", *(f"{name}{_TRACK_UNITS.get(name, '')}" for name in names))
        rows = [
            [_name_cell(label), *(_tracking_cell(name, row.get(name)) for name in names)]
            for label, row in {**classes, "mean": {**tracking, **total}}.items()
        ]
        yield FigureTable(title, heads, rows)


def segmentation_table(segmentation: Figures) -> FigureTable:
    """Table with a row per class: IoU at each score threshold; the last row is the mean."""
    means = segmentation["mean_IoU_at"]
    rows = [[_name_cell(name), *_share_cells(values.values())] for name, values in segmentation["IoU_at"].items()]
    rows.append([_name_cell("mean"), *_share_cells(means.values())])
    return FigureTable("bird's-eye-view IoU by threshold of the score", ("class", *means), rows)


def condition_table(condition: str, figures: Figures, *, with_empty: bool = False) -> FigureTable:
    """Table with a row per slice of a condition, such as ``weather``; empty slices only if ``with_empty``."""
    boxes, cells, tracks = (
        figures.get(part, {}).get(f"by_{condition}", {}) for part in ("detection", "segmentation", "tracking")
    )
    methods = measured_methods(boxes.values())
    scores = [(method, score) for method in methods for score in ("mAP", "SDS")]
    heads = ["boxes", *(f"{score}, {METHOD_NAMES[method]}" for method, score in scores)] if boxes else []
    heads += [*_TRACK_SCORES] if tracks else []
    heads += ["frames", "mean IoU"] if cells else []
    rows = []
    for name in dict.fromkeys((*boxes, *cells)):
        values, cell_values = boxes.get(name, {}), cells.get(name, {})
        if with_empty or values.get("boxes") or cell_values.get("frames"):
            row = (
                [_count_cell(values["boxes"]), *_share_cells(values[m][score] for m, score in scores)] if boxes else []
            )
            row += _share_cells(tracks[name][score] for score in _TRACK_SCORES) if tracks else []
            row += (
                [_count_cell(cell_values["frames"]), _share_cell(at_table_threshold(cell_values["mean_IoU_at"]))]
                if cells
                else []
            )
            rows.append([_name_cell(name), *row])
    return FigureTable(f"by {condition}", (condition, *heads), rows)


def nuscenes_table(nuscenes: Figures) -> FigureTable:
    """NuScenes metrics: means over all classes and over those that occur, then a row per class with AP and errors."""
    classes, occurring = nuscenes["classes"], nuscenes["occurring"]
    distances = list(next(iter(classes.values()))["AP_at"])
    errors = [name for name in nuscenes if name not in ("classes", "occurring", "mAP", "NDS")]
    blank = [Cell(CellKind.NAME, "")] * len(distances)
    count = sum(values["boxes"] > 0 for values in classes.values())
    means = {f"all {len(classes)}": nuscenes}
    if occurring is not None and count < len(classes):
        means[f"the {count} that occur"] = occurring
    rows = [
        [
            _name_cell(name),
            _count_cell(sum(values["boxes"] for values in classes.values())),
            _share_cell(mean["mAP"]),
            *blank,
            *_number_cells(mean[error] for error in errors),
        ]
        for name, mean in means.items()
    ]
    rows += [
        [
            _name_cell(name),
            _count_cell(values["boxes"]),
            _share_cell(values["AP"]),
            *_share_cells(values["AP_at"].values()),
            *_number_cells(values[error] for error in errors),
        ]
        for name, values in classes.items()
    ]
    heads = ("class", "boxes", "AP", *(f"< {each} m" for each in distances), *errors)
    return FigureTable(_nuscenes_title(nuscenes), heads, rows)


def _nuscenes_title(nuscenes: Figures) -> str:
    """Title with the devkit's totals and, where classes have no boxes, those over the classes that occur."""
    classes, occurring = nuscenes["classes"], nuscenes["occurring"]
    count = sum(values["boxes"] > 0 for values in classes.values())
    title = f"nuScenes: {_nuscenes_totals(nuscenes)}"
    if occurring is None or count == len(classes):
        return title
    return f"{title}; over the {count} of {len(classes)} classes that occur: {_nuscenes_totals(occurring)}"


def _nuscenes_totals(figures: Figures) -> str:
    return f"mAP {text_of(figures['mAP'])}, NDS {text_of(figures['NDS'])}"


def measured_methods(boxes: Iterable[Figures]) -> list[str]:
    """Matching methods for which at least one of these detection results has values."""
    known = list(boxes)
    return [method for method in METHODS if any(method in figures for figures in known)]


def conditions_of(figures: Figures) -> list[str]:
    """Conditions by which these values are sliced, such as ``weather``."""
    keys = (key for part in ("detection", "segmentation") for key in figures.get(part, ()))
    return list(dict.fromkeys(key.removeprefix("by_") for key in keys if key.startswith("by_")))


def at_table_threshold(figures: Mapping[str, float | None]) -> float | None:
    """The value at the score threshold that tables and charts show."""
    return figures[f"{TABLE_THRESHOLD:g}"]


def text_of(value: float | None) -> str:
    """A value as all tables print it; a dash if it is undefined."""
    return "–" if value is None else f"{value:.3f}"


def _tracking_cell(metric: str, value: float | None) -> Cell:
    if metric in _TRACK_COUNTS and value is not None:
        return _count_cell(round(value))
    return Cell(CellKind.NUMBER if metric in _TRACK_UNITS else CellKind.SHARE, value)


def _name_cell(text: str) -> Cell:
    return Cell(CellKind.NAME, text)


def _count_cell(value: int) -> Cell:
    return Cell(CellKind.COUNT, value)


def _share_cell(value: float | None) -> Cell:
    return Cell(CellKind.SHARE, value)


def _share_cells(values: Iterable[float | None]) -> list[Cell]:
    return [_share_cell(value) for value in values]


def _number_cells(values: Iterable[float | None]) -> list[Cell]:
    return [Cell(CellKind.NUMBER, value) for value in values]
