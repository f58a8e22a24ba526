"""Pictures of single frames: which boxes were found and missed, from above and in a camera, as SVG.

The style sheet of the page gives boxes their colours by their classes there: found, missed, false, unsure, uncounted.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.annotation.boxes.boxes import blank
from simbev_ros.dataset import Frame
from simbev_ros.evaluation.metrics.boxes import Boxes
from simbev_ros.evaluation.metrics.detection import HIT, MISS
from simbev_ros.evaluation.scene_boxes import Outcomes
from simbev_ros.geometry.transforms import inverse
from simbev_ros.semantics import BEV_CLASSES, BOX_CLASSES
from simbev_ros.types import AnyArray, BoolArray, Float64Array, Int64Array, Table, UInt8Array
from simbev_ros.viz.box_lines import outlines
from simbev_ros.viz.reports.evaluation_charts import class_colors
from simbev_ros.viz.reports.svg_charts import words
from simbev_ros.viz.reports.svg_drawing import Drawing
from simbev_ros.viz.sheet.truth import level

_SIDE = 640.0
_LEAST_SIDE = 4.0
"""Smaller boxes are drawn that large, in units of the sheet."""
_MARGIN_M = 6.0
_RING_M = 20
_GROUND = ("sidewalk", "road", "hazard", "crosswalk", "road_line", "barrier", "traffic_cone")
"""Classes of cells that are shown below boxes, in painting order."""
_GROUND_OPACITY = 90


@dataclass(frozen=True, slots=True, eq=False)
class MarkedBoxes:
    """Boxes of one kind in a picture.

    Attributes:
        kind: Their class in the style sheet.
        table: (N,) ``BOX_DTYPE``, map frame.
        titles: (N,) what browsers show under the pointer.
    """

    kind: str
    table: Table
    titles: Sequence[str]


def marked_boxes(outcomes: Outcomes) -> list[MarkedBoxes]:
    """All boxes of one frame, in painting order."""
    table, predicted = outcomes.table, outcomes.predictions
    rows = rows_of(predicted.boxes)
    scores = [f"score {score:.3g}" for score in predicted.score.tolist()]
    wrong = outcomes.taken & (outcomes.outcome == MISS)
    unsure = _surest(~outcomes.taken & (outcomes.outcome >= 0), predicted.score, len(table))

    def of_truth(kind: str, said: str, chosen: BoolArray) -> MarkedBoxes:
        about = [_about(row) for row in table[chosen]]
        return MarkedBoxes(kind, table[chosen], _titles(table[chosen], [f"{said}, {each}" for each in about]))

    def of_predictions(kind: str, said: str, chosen: AnyArray) -> MarkedBoxes:
        about = [f"{said}, {scores[index]}" for index in np.arange(len(rows))[chosen].tolist()]
        return MarkedBoxes(kind, rows[chosen], _titles(rows[chosen], about))

    return [
        of_truth("uncounted", "does not count", ~outcomes.counted),
        of_predictions("unsure", "predicted, but less sure than others", unsure),
        of_truth("found", "found", outcomes.found),
        of_predictions("answer", "predicted rightly", outcomes.taken & (outcomes.outcome == HIT)),
        of_predictions("false", "predicted in vain", wrong),
        of_truth("missed", "missed", outcomes.counted & ~outcomes.found),
    ]


def from_above(frame: Frame, boxes: Iterable[MarkedBoxes], half_extent_m: float) -> str:
    """A frame's boxes over its cells, the ego in the middle, looking up.

    Args:
        frame: Where the ego is, and its bird's-eye-view labels, if there are some.
        boxes: In painting order.
        half_extent_m: From the ego to the edges.
    """
    sheet, grid = Drawing(_SIDE, _SIDE), frame.scene.spec.annotation.bev.grid
    scale = _SIDE / (2.0 * half_extent_m)
    if "bev/labels" in frame:
        rows, columns = frame["bev/labels"].shape
        width, height = (count * grid.cell_m * scale for count in (columns, rows))
        place = (_SIDE - width) / 2.0, (_SIDE - height) / 2.0
        sheet.picture(*place, (width, height), *_ground(frame["bev/labels"]))
    for radius_m in range(_RING_M, int(half_extent_m) + 1, _RING_M):
        sheet.add(f'<circle class="ring" cx="{_SIDE / 2}" cy="{_SIDE / 2}" r="{radius_m * scale:.1f}"/>')
        if radius_m % (2 * _RING_M) == 0:
            sheet.text(_SIDE / 2 + 4, _SIDE / 2 - radius_m * scale + 12, f"{radius_m} m", "tick", "start")
    grid_from_map = inverse(level(frame.map_from_ego))
    for each in boxes:
        for points, title in zip(_outlines(each.table, grid_from_map, scale), each.titles, strict=True):
            sheet.path(each.kind, _path(points), title)
    sheet.mark_ego(_SIDE / 2, _SIDE / 2)
    return sheet.svg()


def extent_m(outcomes: Outcomes, least_m: float) -> float:
    """From the ego to the edges of a picture that has all boxes of the truth that count, and at least so much."""
    farthest_m = outcomes.table["distance"][outcomes.counted].max(initial=0.0)
    return max(float(farthest_m) + _MARGIN_M, least_m)


def rows_of(boxes: Boxes) -> Table:
    """(N,) rows of /ego/boxes with the places, sizes and classes of boxes."""
    table = blank(len(boxes))
    for axis, name in enumerate("xyz"):
        table[name] = boxes.center_m[:, axis]
    for axis, name in enumerate(("length", "width", "height")):
        table[name] = boxes.size_m[:, axis]
    table["yaw"], table["class"] = boxes.yaw_rad, boxes.label
    return table


def _surest(chosen: BoolArray, score: Float64Array, count: int) -> Int64Array:
    """The surest of those that are chosen, so that pictures do not fill with what is hardly said."""
    rows = np.flatnonzero(chosen)
    return rows[np.argsort(-score[rows], kind="stable")[:count]]


def _titles(table: Table, said: Iterable[str]) -> list[str]:
    names = (words(BOX_CLASSES[label]) for label in table["class"].tolist())
    return [f"{name}: {text}" for name, text in zip(names, said, strict=True)]


def _about(row: Table) -> str:
    """What the dataset says of a box of the truth."""
    points = max(int(row["lidar_points"]), 0) + max(int(row["radar_points"]), 0)
    return f"{float(row['distance']):.0f} m away, {points} points"


def _outlines(table: Table, grid_from_map: Float64Array, scale: float) -> Float64Array:
    """(N, 6, 2) corners and headings on the sheet."""
    drawn = table.copy()
    for name in ("length", "width"):
        drawn[name] = np.maximum(drawn[name], _LEAST_SIDE / scale)
    places: Float64Array = _SIDE / 2.0 - outlines(drawn, grid_from_map)[..., ::-1] * scale
    return places


def _path(points: Float64Array) -> str:
    corners, heading = ("L".join(f"{x:.1f} {y:.1f}" for x, y in part) for part in (points[:4], points[4:]))
    return f"M{corners}ZM{heading}"


def _ground(labels: AnyArray) -> tuple[UInt8Array, UInt8Array]:
    """Picture of (H, W) labels: indices, and colours with opacities; of several classes the uppermost is seen."""
    indices, ramp = np.zeros(labels.shape, np.uint8), np.zeros((256, 4), np.uint8)
    for index, name in enumerate(_GROUND, start=1):
        indices[labels >> BEV_CLASSES.index(name) & 1 == 1] = index
        ramp[index] = *class_colors()[name], _GROUND_OPACITY
    return indices, ramp
