"""Tables of an evaluation in the terminal: totals, then by class, by threshold and by condition."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from simbev_ros.cli.console import plural

_METHODS = {"iou": "3D IoU", "distance": "distance"}
_ERRORS = ("ATE", "AOE", "ASE", "AVE")
_TOTALS = ("mAP", *_ERRORS, "SDS")
_UNITS = {"ATE": " m", "AOE": " rad", "AVE": " m/s"}
_TABLE_THRESHOLD = "0.5"

_Figures = Mapping[str, Any]


def print_tables(figures: _Figures, console: Console) -> None:
    """Print ``evaluation.figures.figures_of`` as tables."""
    frames = figures["frames"]
    answered = ", ".join(
        f"{frames[f'answered_{what}']} with {what}" for what in ("boxes", "grids") if frames[f"answered_{what}"]
    )
    counted = f"{plural(frames['evaluated'], 'frame')} of {plural(frames['scenes'], 'scene')}"
    console.print(f"{counted}; answered: {answered or 'none'}", soft_wrap=True)
    for table in _tables(figures):
        if not console.is_terminal:  # in a file nothing is cut off
            console.width = max(console.width, console.measure(table).maximum)
        console.print(table)


def _tables(figures: _Figures) -> Iterator[Table]:
    if detection := figures.get("detection"):
        methods = [method for method in _METHODS if method in detection]
        yield _summary(detection, methods)
        yield from (_precisions(detection, method) for method in methods)
        yield _errors(detection, methods)
    if segmentation := figures.get("segmentation"):
        yield _cells(segmentation)
    for key in dict.fromkeys(key for part in ("detection", "segmentation") for key in figures.get(part, ())):
        if key.startswith("by_"):
            yield _rows_by(key, figures)
    if nuscenes := figures.get("nuscenes"):
        yield _nuscenes(nuscenes)


def _summary(detection: _Figures, methods: Sequence[str]) -> Table:
    table = _table("boxes", "matched by", *(f"{name}{_UNITS.get(name, '')}" for name in _TOTALS))
    for method in methods:
        table.add_row(_METHODS[method], *(_text(detection[method][name]) for name in _TOTALS))
    return table


def _precisions(detection: _Figures, method: str) -> Table:
    classes = {name: values[method] for name, values in detection["classes"].items()}
    thresholds = list(next(iter(classes.values()))["AP_at"]) if classes else []
    signed = [f"> {each}" if method == "iou" else f"< {each} m" for each in thresholds]
    table = _table(f"average precision by {_METHODS[method]}", "class", "boxes", "mean", *signed)
    for name, values in classes.items():
        boxes = str(detection["classes"][name]["boxes"])
        table.add_row(name, boxes, _text(values["AP"]), *(_text(values["AP_at"][each]) for each in thresholds))
    return table


def _errors(detection: _Figures, methods: Sequence[str]) -> Table:
    """Errors of matched boxes, averaged over the thresholds."""
    table = _table(
        f"errors, matched by {' and by '.join(_METHODS[method] for method in methods)}",
        "class",
        *(f"{name}{_UNITS.get(name, '')}" for _ in methods for name in _ERRORS),
    )
    for name, values in detection["classes"].items():
        table.add_row(name, *(_text(values[method][each]) for method in methods for each in _ERRORS))
    return table


def _cells(segmentation: _Figures) -> Table:
    thresholds = list(segmentation["mean_IoU_at"])
    table = _table("bird's-eye-view IoU by threshold of the score", "class", *thresholds)
    for name, values in segmentation["IoU_at"].items():
        table.add_row(name, *(_text(values[each]) for each in thresholds))
    table.add_section()
    table.add_row("mean", *(_text(segmentation["mean_IoU_at"][each]) for each in thresholds))
    return table


def _rows_by(key: str, figures: _Figures) -> Table:
    boxes, cells = (figures.get(part, {}).get(key, {}) for part in ("detection", "segmentation"))
    methods = [method for method in _METHODS if any(method in values for values in boxes.values())]
    heads = [f"{name}, {_METHODS[method]}" for method in methods for name in ("mAP", "SDS")]
    condition = key.removeprefix("by_")
    table = _table(
        f"by {condition}", condition, *(["boxes", *heads] if boxes else []), *(["mean IoU"] if cells else [])
    )
    for name in dict.fromkeys((*boxes, *cells)):
        if not boxes.get(name, {}).get("boxes") and not cells.get(name, {}).get("frames"):
            continue
        row = [name]
        if boxes:
            own = boxes[name]
            row += [str(own["boxes"]), *(_text(own[method][each]) for method in methods for each in ("mAP", "SDS"))]
        if cells:
            row.append(_text(cells.get(name, {}).get("mean_IoU_at", {}).get(_TABLE_THRESHOLD)))
        table.add_row(*row)
    return table


def _nuscenes(figures: _Figures) -> Table:
    names = [name for name in figures if name not in ("classes", "mAP", "NDS")]
    errors = ", ".join(f"{name} {_text(figures[name])}" for name in names)
    title = f"nuScenes: mAP {_text(figures['mAP'])}, NDS {_text(figures['NDS'])}, {errors}"
    table = _table(title, "class", "AP", *names)
    for name, values in figures["classes"].items():
        table.add_row(name, _text(values["AP"]), *(_text(values[each]) for each in names))
    return table


def _table(title: str, first: str, *others: str) -> Table:
    table = Table(first, title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in others:
        table.add_column(name, justify="right")
    return table


def _text(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
