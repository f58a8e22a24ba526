"""Shows the worst frames of an evaluation with pictures, as HTML cards for its report.

An ``Evaluation``, its scenes and predictions enter; HTML leaves.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from html import escape

import numpy as np

from simbev_ros.dataset import Frame, Scene
from simbev_ros.evaluation.evaluation import Evaluation
from simbev_ros.evaluation.metrics.detection import MISS
from simbev_ros.evaluation.predictions.dataset_predictions import PredictedScene, PredictionSet
from simbev_ros.evaluation.scene_boxes import Outcomes
from simbev_ros.evaluation.scene_evaluation import outcomes_of
from simbev_ros.evaluation.slices import Conditions
from simbev_ros.evaluation.worst_frames import WorstFrame, worst_frames, worst_grids
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.palette import class_color
from simbev_ros.show.reports.evaluation_cameras import camera_picture
from simbev_ros.show.reports.evaluation_grids import FALSE, MISSED, RIGHT, grid_pictures
from simbev_ros.show.reports.evaluation_pictures import marked_boxes, picture_half_extent_m, top_view
from simbev_ros.show.reports.page import legend, words
from simbev_ros.show.reports.page import table as html_table
from simbev_ros.show.reports.svg_drawing import Color

_MIN_INTERVAL_S = 1.0
_FRAMES, _GRIDS = 12, 6
_KINDS = {
    "found": "found",
    "missed": "missed",
    "answer": "predicted correctly",
    "false": "predicted falsely",
    "unsure": "predicted, but with a lower score than others",
    "uncounted": "does not count",
}
_Choice = Callable[[Mapping[str, Table], int, Callable[[str], int]], list[WorstFrame]]


def worst_frame_cards(evaluation: Evaluation, scenes: Sequence[Scene], predictions: PredictionSet) -> str:
    """Cards of the frames with the most missed boxes, from above and in a camera; empty if boxes are not evaluated."""
    if not evaluation.detections:
        return ""
    items = "".join(f'<span><i class="{kind}"></i>{caption}</span>' for kind, caption in _KINDS.items())
    cards = "".join(
        _frame_card(each, frame, outcomes_of(frame.scene, predicted, each.tick, evaluation.options))
        for each, frame, predicted in _chosen_frames(worst_frames, _FRAMES, evaluation, scenes, predictions)
    )
    return f'<p class="legend">{items}</p>{cards}' if cards else ""


def worst_grid_cards(evaluation: Evaluation, scenes: Sequence[Scene], predictions: PredictionSet) -> str:
    """Cards of the frames with the lowest IoU of cells; empty if grids are not evaluated."""
    if not evaluation.segmentations:
        return ""
    cards = []
    for each, frame, predicted in _chosen_frames(worst_grids, _GRIDS, evaluation, scenes, predictions):
        grid = predicted.grid(each.tick)
        if grid is not None:
            pictures = grid_pictures(frame, grid, evaluation.grid_classes)
            views = "".join(_view(caption, picture) for caption, picture in pictures.items())
            cards.append(_card(frame, f"mean IoU {each.iou:.3f}", f'<div class="cells">{views}</div>'))
    return f"{legend(_cell_colors(evaluation.grid_classes))}{''.join(cards)}" if cards else ""


def _cell_colors(classes: Sequence[str]) -> dict[str, Color]:
    return {"right": RIGHT, "missed": MISSED, "false": FALSE, **{words(name): class_color(name) for name in classes}}


def _chosen_frames(
    choose: _Choice, count: int, evaluation: Evaluation, scenes: Sequence[Scene], predictions: PredictionSet
) -> Iterator[tuple[WorstFrame, Frame, PredictedScene]]:
    by_name, predicted = {scene.name: scene for scene in scenes}, dict[str, PredictedScene]()
    min_interval_ns = _MIN_INTERVAL_S * NS_PER_S
    for each in choose(evaluation.frames, count, lambda name: round(min_interval_ns / by_name[name].tick_ns)):
        scene = by_name[each.scene]
        if each.scene not in predicted:
            predicted[each.scene] = predictions.scene(scene.name, scene.stamps_ns)
        yield each, scene[each.tick], predicted[each.scene]


def _frame_card(worst: WorstFrame, frame: Frame, outcomes: Outcomes) -> str:
    boxes = marked_boxes(outcomes)
    grid = frame.scene.view.annotation.bev
    picture = top_view(frame, boxes, picture_half_extent_m(outcomes, grid.columns * grid.cell_m / 2.0))
    views, seen = _view("from above", picture), camera_picture(frame, outcomes, boxes)
    if seen is not None:
        views += _view(seen[1], seen[0])
    caption = f"{worst.found} of {worst.boxes} boxes found"
    return _card(frame, caption, f'<div class="views">{views}<div>{_class_table(outcomes)}</div></div>')


def _class_table(outcomes: Outcomes) -> str:
    """HTML table with the outcomes of the boxes of each class."""
    table, missed = outcomes.table, outcomes.counted & ~outcomes.found
    sensed = np.maximum(table["lidar_points"], table["radar_points"]) > 0
    false_labels = outcomes.predictions.boxes.label[outcomes.taken & (outcomes.outcome == MISS)]
    shown = (table["class"][chosen] for chosen in (outcomes.counted, outcomes.found, missed, missed & sensed))
    columns = [np.bincount(labels, minlength=len(BOX_CLASSES)) for labels in (*shown, false_labels)]
    rows = [
        f"<th>{words(name)}</th>" + "".join(f"<td>{count or '–'}</td>" for count in counts)
        for name, *counts in zip(BOX_CLASSES, *(column.tolist() for column in columns), strict=True)
        if any(counts)
    ]
    return html_table(("class", "boxes", "found", "missed", "of them with points", "false"), rows)


def _card(frame: Frame, note: str, body: str) -> str:
    scene = frame.scene
    time_s = (frame.stamp_ns - int(scene.stamps_ns[0])) / NS_PER_S
    where = f"tick {frame.tick}, {time_s:.2f} s, {', '.join(Conditions.of_tick(scene.spec, frame.tick)[:2])}"
    head = f"<h3>{escape(scene.name)} <span>{where}</span></h3>"
    return f'<article>{head}<p class="note">{escape(note)}</p>{body}</article>'


def _view(caption: str, picture: str) -> str:
    return f'<div><p class="note">{escape(caption)}</p>{picture}</div>'
