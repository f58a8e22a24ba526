"""The tables of an evaluation as HTML: all, each class, each threshold, each condition, each scene."""

from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

import numpy as np

from simbev_ros.evaluation.evaluation import Evaluation
from simbev_ros.evaluation.metrics.segmentation import TABLE_THRESHOLD
from simbev_ros.types import BoolArray, Table
from simbev_ros.viz.reports.page import table
from simbev_ros.viz.reports.svg_charts import words

METHODS: Mapping[str, str] = {"iou": "3D IoU", "distance": "distance"}
"""As people say them."""
ERRORS: Mapping[str, str] = {"ATE": "ATE m", "AOE": "AOE rad", "ASE": "ASE", "AVE": "AVE m/s"}
"""With their units."""

_ANSWERED = {"answered_boxes": "with boxes", "answered_grid": "with grids"}
_SPANS = 3

Figures = Mapping[str, Any]
"""Of ``evaluation.figures.figures_of``, or a part of it."""


def at_table_threshold(figures: Figures) -> float | None:
    """The figure at the threshold of scores that tables have."""
    value: float | None = figures[f"{TABLE_THRESHOLD:g}"]
    return value


def text_of(value: float | None) -> str:
    """As all tables have figures; what is undefined is a dash."""
    return "–" if value is None else f"{value:.3f}"


def summary_table(detection: Figures) -> str:
    """By method: mAP, errors, SDS."""
    rows = []
    for method, name in METHODS.items():
        if method in detection:
            own = detection[method]
            errors = "".join(_plain(own[error]) for error in ERRORS)
            rows.append(f"<th>{name}</th>{_share(own['mAP'])}{errors}{_share(own['SDS'])}")
    return table(("matched by", "mAP", *ERRORS.values(), "SDS"), rows)


def precision_table(detection: Figures, method: str) -> str:
    """AP at each threshold, and the errors, by class."""
    classes = detection["classes"]
    thresholds = list(next(iter(classes.values()))[method]["AP_at"]) if classes else []
    signed = [f"> {each}" if method == "iou" else f"< {each} m" for each in thresholds]
    rows = []
    for name, values in classes.items():
        own = values[method]
        shares = "".join(_share(own["AP_at"][each]) for each in thresholds)
        errors = "".join(_plain(own[error]) for error in ERRORS)
        rows.append(f"{_name(name)}{_count(values['boxes'])}{_share(own['AP'])}{shares}{errors}")
    return table(("class", "boxes", "AP", *signed, *ERRORS.values()), rows)


def cell_table(segmentation: Figures) -> str:
    """IoU by class and threshold."""
    means = segmentation["mean_IoU_at"]
    rows = [_name(name) + _shares(values.values()) for name, values in segmentation["IoU_at"].items()]
    return table(("class, score from", *means), [*rows, f"<th>mean</th>{_shares(means.values())}"])


def condition_table(key: str, boxes: Figures, cells: Figures) -> str:
    """A row for each part of what counts.

    Args:
        key: Of what it is cut by.
        boxes: Figures of detection by row; may be empty.
        cells: Figures of segmentation by row; may be empty.
    """
    methods = methods_of(boxes)
    heads = [f"{name}, {METHODS[method]}" for method in methods for name in ("mAP", "SDS")]
    rows = []
    for name in dict.fromkeys((*boxes, *cells)):
        row = f"<th>{escape(name)}</th>"
        if boxes:
            row += _count(boxes[name]["boxes"])
            row += _shares(boxes[name][method][each] for method in methods for each in ("mAP", "SDS"))
        if cells:
            row += _count(cells[name]["frames"]) + _share(at_table_threshold(cells[name]["mean_IoU_at"]))
        rows.append(row)
    return table((key, *(("boxes", *heads) if boxes else ()), *(("frames", "mean IoU") if cells else ())), rows)


def methods_of(boxes: Figures) -> list[str]:
    """Those that were measured, of figures of detection by row."""
    return [method for method in METHODS if any(method in values for values in boxes.values())]


def nuscenes_table(nuscenes: Figures) -> str:
    """AP at each distance, and the errors, by class."""
    classes = nuscenes["classes"]
    distances = list(next(iter(classes.values()))["AP_at"])
    errors = [name for name in nuscenes if name not in ("classes", "mAP", "NDS")]
    rows = [f"<th>mean</th>{_share(nuscenes['mAP'])}{'<td></td>' * len(distances)}{_plains(nuscenes, errors)}"]
    for name, own in classes.items():
        shares = _shares(own["AP_at"][each] for each in distances)
        rows.append(f"{_name(name)}{_share(own['AP'])}{shares}{_plains(own, errors)}")
    return table(("class", "AP", *(f"< {each} m" for each in distances), *errors), rows)


def scene_table(evaluation: Evaluation) -> str:
    """A row for each scene: what was answered, and how well."""
    boxes, grids = bool(evaluation.detections), bool(evaluation.segmentations)
    asked = [*(["answered_boxes"] if boxes else []), *(["answered_grid"] if grids else [])]
    lacking = any(not frames[name].all() for frames in evaluation.frames.values() for name in asked)
    heads = ["scene", "frames", *(_ANSWERED[name] for name in asked), *(["boxes", "found"] if boxes else [])]
    rows = []
    for scene, frames in evaluation.frames.items():
        row = f"<th>{escape(scene)}</th>{_count(len(frames))}"
        row += "".join(_answered(frames[name]) for name in asked)
        if boxes:
            count, found = int(frames["boxes"].sum()), int(frames["found"].sum())
            row += _count(count) + _share(found / count if count else None)
        row += _share(_mean(frames)) if grids else ""
        rows.append(row + ("".join(f"<td>{_unanswered(frames, name)}</td>" for name in asked) if lacking else ""))
    lacks = [f"ticks without {_ANSWERED[name].removeprefix('with ')}" for name in asked] if lacking else []
    return table([*heads, *(["mean IoU"] if grids else []), *lacks], rows)


def _answered(answered: BoolArray) -> str:
    count = int(answered.sum())
    kind = "" if count == len(answered) else ' class="lacking"'
    return f"<td{kind}>{count:,}</td>"


def _unanswered(frames: Table, name: str) -> str:
    """Ticks of frames that were not answered, as the first few spans."""
    rows = np.flatnonzero(~frames[name])
    spans = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if len(rows) else []
    ends = [(int(frames["tick"][span[0]]), int(frames["tick"][span[-1]])) for span in spans[:_SPANS]]
    said = [f"{first}–{last}" if first != last else f"{first}" for first, last in ends]
    return ", ".join([*said, *(["…"] if len(spans) > _SPANS else [])])


def _mean(frames: Table) -> float | None:
    known = frames["iou"][frames["iou"] >= 0]
    return float(known.mean()) if len(known) else None


def _name(name: str) -> str:
    return f"<th>{escape(words(name))}</th>"


def _count(value: int) -> str:
    return f"<td>{value:,}</td>"


def _plain(value: float | None) -> str:
    return f"<td>{text_of(value)}</td>"


def _plains(values: Figures, names: Iterable[str]) -> str:
    return "".join(_plain(values[name]) for name in names)


def _share(value: float | None) -> str:
    """Shaded by what it says."""
    return _plain(value) if value is None else f'<td class="share" style="--v:{value:.3f}">{value:.3f}</td>'


def _shares(values: Iterable[float | None]) -> str:
    return "".join(_share(value) for value in values)
