"""Builds the report of an evaluation: from an ``Evaluation`` and its figures to one self-contained HTML page."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from simbev_ros.dataset import Scene
from simbev_ros.evaluation.evaluation import Evaluation
from simbev_ros.evaluation.figures import METHODS
from simbev_ros.evaluation.predictions.dataset_predictions import PredictionSet
from simbev_ros.evaluation.scene_boxes import found_column
from simbev_ros.evaluation.tables import (
    METHOD_NAMES,
    Figures,
    FigureTable,
    condition_table,
    conditions_of,
    error_table,
    nuscenes_table,
    precision_table,
    segmentation_table,
    summary_table,
    text_of,
    tracking_tables,
)
from simbev_ros.foundation.files.whole_files import write_errors, write_whole
from simbev_ros.show.pages.web_page import web_page
from simbev_ros.show.reports.evaluation_charts import (
    cell_figures,
    condition_figures,
    precision_recall_figures,
    profile_colors,
    threshold_colors,
    threshold_name,
)
from simbev_ros.show.reports.evaluation_facts import facts, headline
from simbev_ros.show.reports.evaluation_frames import worst_frame_cards, worst_grid_cards
from simbev_ros.show.reports.evaluation_tables import html_table, scene_table
from simbev_ros.show.reports.page import key_figures, legend, section, sheet

_BOXES_NOTE = (
    "Errors are those of matched boxes, means over thresholds and classes. A class without boxes is in no mean; where "
    "nothing matches, an error counts as 1."
)

_NUSCENES_NOTE = (
    "Its own metrics, over its classes, ranges and keyframes. In NDS and mAP, classes that do not occur count 0."
)

_TRACKS_NOTE = (
    "Centers of matches are nearer than 2 m in the plane. AMOTA and AMOTP are means over 40 recalls; the other "
    "metrics are of the tracks with at least the mean score in the table, at which MOTA is highest."
)

_SCENES_NOTE = (
    "Found: share of a frame's boxes that the same number of top-scored predictions find. Frames without an answer "
    "count as missed."
)


def write_evaluation_report(
    path: Path,
    evaluation: Evaluation,
    scenes: Sequence[Scene],
    predictions: PredictionSet,
    figures: Figures,
    drives: Sequence[FigureTable] = (),
) -> None:
    """Write the report page with pictures of the worst frames.

    Args:
        path: The HTML file.
        evaluation: The evaluation to show.
        scenes: The evaluated scenes.
        predictions: Their predictions.
        figures: Result of ``evaluation.figures.figures_of``, plus the names of the ``dataset`` and the ``predictions``.
        drives: Tables of the drives of the scenes.

    Raises:
        InputError: The file cannot be written.
    """
    boxes, cells = (cards(evaluation, scenes, predictions) for cards in (worst_frame_cards, worst_grid_cards))
    text = evaluation_report(evaluation, figures, boxes, cells, drives)
    with write_errors(path):
        write_whole(path, text.encode())


def evaluation_report(
    evaluation: Evaluation, figures: Figures, boxes: str = "", cells: str = "", drives: Sequence[FigureTable] = ()
) -> str:
    """The report of an evaluation as a self-contained HTML page.

    Args:
        evaluation: The evaluation to show.
        figures: As for ``write_evaluation_report``.
        boxes: HTML of the frames with the most missed boxes, or empty.
        cells: HTML of the frames with the lowest IoU of cells, or empty.
        drives: As for ``write_evaluation_report``.
    """
    detection, segmentation = figures.get("detection", {}), figures.get("segmentation", {})
    sections = [
        _boxes(evaluation, detection),
        _tracking(figures.get("tracking", {})),
        _cells(segmentation),
        *_conditions(figures),
        _nuscenes(figures.get("nuscenes", {})),
        section("Drives", "".join(map(html_table, drives))),
        section("Scenes", scene_table(evaluation), _SCENES_NOTE),
        section("Frames with the most missed boxes", boxes, _found_note(evaluation)),
        section("Frames with the lowest IoU of cells", cells, "Evaluated classes, at the table's threshold."),
    ]
    head = key_figures(headline(figures)) + facts(figures, evaluation.options)
    title = " on ".join(Path(figures[what]).resolve().name for what in ("predictions", "dataset"))
    return web_page(title, head, "".join(sections), ["charts.js"], is_single=True)


def _boxes(evaluation: Evaluation, detection: Figures) -> str:
    """Section with the tables and curves of detection."""
    if not detection:
        return ""
    parts = [html_table(summary_table(detection))]
    for method in METHODS:
        if method in detection:
            table = html_table(precision_table(detection, method))
            parts.append(f"<h3>Matched by {METHOD_NAMES[method]}</h3>{table}")
            parts.append(legend(threshold_colors(evaluation, method)))
            parts.append(sheet("small", precision_recall_figures(evaluation, detection, method)))
    errors = error_table(detection)
    parts.append(f"<h3>Mean {errors.title}</h3>{html_table(errors)}")
    return section("Boxes", "".join(parts), _BOXES_NOTE)


def _found_note(evaluation: Evaluation) -> str:
    method, limit = evaluation.options.detection.thresholds[found_column(evaluation.options.detection)]
    return (
        f"Of each class, only as many top-scored predictions are used as the frame has boxes. Matched by "
        f"{METHOD_NAMES[method]}, {threshold_name(method, limit)}. Point at a box to read what it is."
    )


def _conditions(figures: Figures) -> Iterator[str]:
    """Sections with tables and charts, one for each condition by which the evaluation is sliced."""
    for condition in conditions_of(figures):
        boxes, cells = (figures.get(part, {}).get(f"by_{condition}", {}) for part in ("detection", "segmentation"))
        charts = sheet("pair", condition_figures(condition, boxes, cells))
        charts = legend(profile_colors(boxes, cells)) + charts if charts else ""
        yield section(f"By {condition}", html_table(condition_table(condition, figures, with_empty=True)) + charts)


def _cells(segmentation: Figures) -> str:
    if not segmentation:
        return ""
    colors = legend(profile_colors({}, {"": segmentation}))
    body = html_table(segmentation_table(segmentation)) + colors + sheet("pair", cell_figures(segmentation))
    return section(
        "Bird's-eye view", body, "IoU of cells by class; a class is present where its score is above the threshold."
    )


def _tracking(tracking: Figures) -> str:
    if not tracking:
        return ""
    shown = [(text_of(tracking[name]), name) for name in ("AMOTA", "HOTA")]
    return section("Tracks", key_figures(shown) + "".join(map(html_table, tracking_tables(tracking))), _TRACKS_NOTE)


def _nuscenes(nuscenes: Figures) -> str:
    if not nuscenes:
        return ""
    shown = [(text_of(nuscenes[name]), name) for name in ("NDS", "mAP")]
    body = key_figures(shown) + html_table(nuscenes_table(nuscenes))
    return section(
        "nuScenes",
        body,
        _NUSCENES_NOTE,
    )
