"""Formats the tables of an evaluation as HTML for its report."""

from html import escape

import numpy as np

from simbev_ros.evaluation.evaluation import Evaluation
from simbev_ros.evaluation.tables import Cell, CellKind, FigureTable, text_of
from simbev_ros.foundation.types import BoolArray, Table
from simbev_ros.show.reports.page import table, words

_ANSWERED = {"answered_boxes": "with boxes", "answered_grid": "with grids"}
_MAX_SPANS = 3


def html_table(figures: FigureTable) -> str:
    """A table of figures as HTML, without its title; shares are shaded by their value."""
    return table(figures.heads, ("".join(map(_cell, row)) for row in figures.rows))


def scene_table(evaluation: Evaluation) -> str:
    """HTML table with a row for each scene: answered frames, found boxes, mean IoU and the unanswered ticks."""
    boxes, grids = bool(evaluation.detections), bool(evaluation.segmentations)
    asked = [*(["answered_boxes"] if boxes else []), *(["answered_grid"] if grids else [])]
    lacking = any(not frames[name].all() for frames in evaluation.frames.values() for name in asked)
    heads = ["scene", "frames", *(_ANSWERED[name] for name in asked), *(["boxes", "found"] if boxes else [])]
    rows = []
    for scene, frames in evaluation.frames.items():
        row = f"<th>{escape(scene)}</th>{_cell(Cell(CellKind.COUNT, len(frames)))}"
        row += "".join(_answered(frames[name]) for name in asked)
        if boxes:
            count, found = int(frames["boxes"].sum()), int(frames["found"].sum())
            row += _cell(Cell(CellKind.COUNT, count)) + _cell(Cell(CellKind.SHARE, found / count if count else None))
        row += _cell(Cell(CellKind.SHARE, _mean(frames))) if grids else ""
        rows.append(row + ("".join(f"<td>{_unanswered(frames, name)}</td>" for name in asked) if lacking else ""))
    lacks = [f"ticks without {_ANSWERED[name].removeprefix('with ')}" for name in asked] if lacking else []
    return table([*heads, *(["mean IoU"] if grids else []), *lacks], rows)


def _answered(answered: BoolArray) -> str:
    count = int(answered.sum())
    kind = "" if count == len(answered) else ' class="lacking"'
    return f"<td{kind}>{count:,}</td>"


def _unanswered(frames: Table, name: str) -> str:
    """Ticks of the frames that were not answered, as text: the first ``_MAX_SPANS`` spans."""
    rows = np.flatnonzero(~frames[name])
    spans = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if len(rows) else []
    ends = [(int(frames["tick"][span[0]]), int(frames["tick"][span[-1]])) for span in spans[:_MAX_SPANS]]
    said = [f"{first}–{last}" if first != last else f"{first}" for first, last in ends]
    return ", ".join([*said, *(["…"] if len(spans) > _MAX_SPANS else [])])


def _mean(frames: Table) -> float | None:
    known = frames["iou"][frames["iou"] >= 0]
    return float(known.mean()) if len(known) else None


def _cell(cell: Cell) -> str:
    match cell.kind:
        case CellKind.NAME:
            return f"<th>{escape(words(str(cell.value)))}</th>"
        case CellKind.COUNT:
            return f"<td>{cell.value:,}</td>"
        case CellKind.SHARE if cell.value is not None:
            return f'<td class="share" style="--v:{cell.value:.3f}">{cell.value:.3f}</td>'
        case _:
            return f"<td>{text_of(None if cell.value is None else float(cell.value))}</td>"
