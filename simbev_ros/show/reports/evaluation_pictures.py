"""Draws single frames of an evaluation from above as SVG: which boxes were found, missed, or predicted falsely.

A frame and the outcomes of its boxes enter; marked boxes, which camera pictures use too, and SVG text leave. The page's
style sheet colors boxes by their class there: found, missed, answer, false, unsure, uncounted.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.dataset import Frame
from simbev_ros.drawing.box_lines import box_outlines
from simbev_ros.evaluation.metrics.boxes import Boxes
from simbev_ros.evaluation.metrics.detection import HIT, MISS
from simbev_ros.evaluation.scene_boxes import Outcomes
from simbev_ros.foundation.geometry.transforms import inverse
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, Int64Array, Table, UInt8Array
from simbev_ros.schema.boxes import blank_boxes
from simbev_ros.schema.palette import chart_color
from simbev_ros.show.reports.page import words
from simbev_ros.show.reports.svg_drawing import Drawing
from simbev_ros.show.sheet.truth import leveled_pose

_SIDE = 640.0
_MIN_BOX_SIDE = 4.0
"""Minimum length and width with which boxes are drawn, in units of the sheet."""
_MARGIN_M = 6.0
_RING_M = 20
_GROUND_CLASSES = ("sidewalk", "road", "hazard", "crosswalk", "road_line", "barrier", "traffic_cone")
"""Bird's-eye-view classes that are shown below boxes, in painting order."""
_GROUND_OPACITY = 90


@dataclass(frozen=True, slots=True, eq=False)
class MarkedBoxes:
    """Boxes of one kind in a picture.

    Attributes:
        kind: Class of the boxes in the style sheet.
        table: (N,) ``BOX_DTYPE``, map frame.
        titles: (N,) texts that browsers show under the pointer.
    """

    kind: str
    table: Table
    titles: Sequence[str]


def marked_boxes(outcomes: Outcomes) -> list[MarkedBoxes]:
    """All ground-truth and predicted boxes of one frame by their outcome, in painting order."""
    table, predicted = outcomes.table, outcomes.predictions
    rows = rows_of(predicted.boxes)
    scores = [f"score {score:.3g}" for score in predicted.score.tolist()]
    wrong = outcomes.taken & (outcomes.outcome == MISS)
    unsure = _top_scored(~outcomes.taken & (outcomes.outcome >= 0), predicted.score, len(table))

    def mark_truth(kind: str, outcome_text: str, chosen: BoolArray) -> MarkedBoxes:
        about = [_describe(row) for row in table[chosen]]
        return MarkedBoxes(kind, table[chosen], _titles(table[chosen], [f"{outcome_text}, {each}" for each in about]))

    def mark_predictions(kind: str, outcome_text: str, chosen: AnyArray) -> MarkedBoxes:
        about = [f"{outcome_text}, {scores[index]}" for index in np.arange(len(rows))[chosen].tolist()]
        return MarkedBoxes(kind, rows[chosen], _titles(rows[chosen], about))

    return [
        mark_truth("uncounted", "does not count", ~outcomes.counted),
        mark_predictions("unsure", "predicted, but with a lower score than others", unsure),
        mark_truth("found", "found", outcomes.found),
        mark_predictions("answer", "predicted correctly", outcomes.taken & (outcomes.outcome == HIT)),
        mark_predictions("false", "predicted falsely", wrong),
        mark_truth("missed", "missed", outcomes.counted & ~outcomes.found),
    ]


def top_view(frame: Frame, boxes: Iterable[MarkedBoxes], half_extent_m: float, labeled: Frame | None = None) -> str:
    """Draw a frame's boxes over bird's-eye-view cells as SVG, the ego in the middle, facing up.

    Args:
        frame: The frame, with the ego's pose.
        boxes: The boxes, in painting order.
        half_extent_m: Distance from the ego to the edges of the picture.
        labeled: A frame nearby whose bird's-eye-view labels are shown, where they belong; None: the frame itself. A
            frame without labels has none to show.
    """
    sheet, scale, labeled = Drawing(_SIDE, _SIDE), _SIDE / (2.0 * half_extent_m), labeled or frame
    if "bev/labels" in labeled:
        _draw_ground(sheet, labeled, inverse(leveled_pose(frame.map_from_ego)), scale)
    for radius_m in range(_RING_M, int(half_extent_m) + 1, _RING_M):
        sheet.add(f'<circle class="ring" cx="{_SIDE / 2}" cy="{_SIDE / 2}" r="{radius_m * scale:.1f}"/>')
        if radius_m % (2 * _RING_M) == 0:
            sheet.text(_SIDE / 2 + 4, _SIDE / 2 - radius_m * scale + 12, f"{radius_m} m", "tick", "start")
    grid_from_map = inverse(leveled_pose(frame.map_from_ego))
    for each in boxes:
        for points, title in zip(_outlines_on_sheet(each.table, grid_from_map, scale), each.titles, strict=True):
            sheet.path(each.kind, _path(points), title)
    sheet.mark_ego(_SIDE / 2, _SIDE / 2)
    return sheet.svg()


def _draw_ground(sheet: Drawing, labeled: Frame, view_from_map: Float64Array, scale: float) -> None:
    """Draw the cells of a labeled frame in the view of another one."""
    rows, columns = labeled["bev/labels"].shape
    width, height = (count * labeled.scene.view.annotation.bev.grid.cell_m * scale for count in (columns, rows))
    moved = view_from_map @ leveled_pose(labeled.map_from_ego)
    turn_deg = -np.degrees(np.arctan2(moved[1, 0], moved[0, 0]))
    right, down = -moved[1, 3] * scale, -moved[0, 3] * scale
    sheet.add(f'<g transform="translate({right:.2f} {down:.2f}) rotate({turn_deg:.3f} {_SIDE / 2} {_SIDE / 2})">')
    corner = (_SIDE - width) / 2.0, (_SIDE - height) / 2.0
    sheet.picture(*corner, (width, height), *_ground(labeled["bev/labels"]))
    sheet.add("</g>")


def picture_half_extent_m(outcomes: Outcomes, min_m: float) -> float:
    """Distance from the ego to the edges of a picture with all counted ground-truth boxes, at least ``min_m``."""
    max_distance_m = outcomes.table["distance"][outcomes.counted].max(initial=0.0)
    return max(float(max_distance_m) + _MARGIN_M, min_m)


def rows_of(boxes: Boxes) -> Table:
    """(N,) rows of /ego/boxes with the positions, sizes, headings and classes of boxes; other columns are blank."""
    table = blank_boxes(len(boxes))
    for axis, name in enumerate("xyz"):
        table[name] = boxes.center_m[:, axis]
    for axis, name in enumerate(("length", "width", "height")):
        table[name] = boxes.size_m[:, axis]
    table["yaw"], table["class"] = boxes.yaw_rad, boxes.label
    return table


def _top_scored(chosen: BoolArray, score: Float64Array, count: int) -> Int64Array:
    """Rows of the ``count`` chosen predictions with the highest scores; unlikely ones would fill the picture."""
    rows = np.flatnonzero(chosen)
    return rows[np.argsort(-score[rows], kind="stable")[:count]]


def _titles(table: Table, outcome_text: Iterable[str]) -> list[str]:
    names = (words(BOX_CLASSES[label]) for label in table["class"].tolist())
    return [f"{name}: {text}" for name, text in zip(names, outcome_text, strict=True)]


def _describe(row: Table) -> str:
    """Distance and sensor points of a ground-truth box, as text."""
    points = max(int(row["lidar_points"]), 0) + max(int(row["radar_points"]), 0)
    return f"{float(row['distance']):.0f} m away, {points} points"


def _outlines_on_sheet(table: Table, grid_from_map: Float64Array, scale: float) -> Float64Array:
    """(N, 6, 2) corners and headings of boxes on the sheet."""
    drawn = table.copy()
    for name in ("length", "width"):
        drawn[name] = np.maximum(drawn[name], _MIN_BOX_SIDE / scale)
    return _SIDE / 2.0 - box_outlines(drawn, grid_from_map)[..., ::-1] * scale


def _path(points: Float64Array) -> str:
    corners, heading = ("L".join(f"{x:.1f} {y:.1f}" for x, y in part) for part in (points[:4], points[4:]))
    return f"M{corners}ZM{heading}"


def _ground(labels: AnyArray) -> tuple[UInt8Array, UInt8Array]:
    """Picture of (H, W) labels: indices, and RGBA colors; the last class in painting order covers the others."""
    indices, ramp = np.zeros(labels.shape, np.uint8), np.zeros((256, 4), np.uint8)
    for index, name in enumerate(_GROUND_CLASSES, start=1):
        indices[labels >> BEV_CLASSES.index(name) & 1 == 1] = index
        ramp[index] = *chart_color(name), _GROUND_OPACITY
    return indices, ramp
