"""Charts of an evaluation report: precision over recall, and metrics over conditions and thresholds.

An ``Evaluation`` or its figures enter; HTML figures leave.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from simbev_ros.evaluation.evaluation import Evaluation
from simbev_ros.evaluation.metrics.detection import Method
from simbev_ros.evaluation.tables import METHOD_NAMES, Figures, at_table_threshold, measured_methods
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES
from simbev_ros.foundation.types import Float64Array
from simbev_ros.schema.palette import chart_color
from simbev_ros.show.pages.charts import Series, figure, share_lines, share_profile
from simbev_ros.show.reports.page import words
from simbev_ros.show.reports.svg_drawing import Color

_SQUARE_PX = 230
_LENIENT, _MIDDLE, _STRICT = (230, 160, 40), (214, 72, 96), (124, 92, 214)
_UNORDERED = ("weather",)


def threshold_colors(evaluation: Evaluation, method: Method) -> dict[str, Color]:
    """Colors of a matching method's thresholds by their names, from the most lenient to the strictest."""
    limits = [limit for each, limit in evaluation.options.detection.thresholds if each == method]
    strictness = sorted(limits, reverse=method == "distance")
    stop_positions = np.linspace(0.0, 2.0, max(len(limits), 2))[: len(limits)]
    stops = np.array([_LENIENT, _MIDDLE, _STRICT], np.float64)
    found = {}
    for limit, stop_position in zip(strictness, stop_positions, strict=True):
        red, green, blue = (round(float(np.interp(stop_position, (0, 1, 2), stops[:, k]))) for k in range(3))
        found[threshold_name(method, limit)] = red, green, blue
    return found


def threshold_name(method: Method, limit: float) -> str:
    """A matching threshold as displayed text."""
    return f"IoU > {limit:g}" if method == "iou" else f"< {limit:g} m"


def precision_recall_figures(evaluation: Evaluation, detection: Figures, method: Method) -> Iterator[str]:
    """Figures of precision over recall: one small chart for each class, with a line for each threshold."""
    colors, thresholds = threshold_colors(evaluation, method), evaluation.options.detection.thresholds
    for name, values in detection["classes"].items():
        lines = []
        for column, (each, limit) in enumerate(thresholds):
            curve = evaluation.curves.get((BOX_CLASSES.index(name), column))
            if each == method and curve is not None and len(curve.recall):
                title = threshold_name(method, limit)
                recall, precision = np.append(0.0, curve.recall), np.append(curve.precision[0], curve.precision)
                lines.append((recall, Series(title, precision, colors[title])))
        note = f"AP {values[method]['AP']:.3f}" if lines else "nothing is predicted"
        yield figure(words(name).capitalize(), share_lines(lines, "recall", "precision", _SQUARE_PX), note)


def condition_figures(key: str, boxes: Figures, cells: Figures) -> Iterator[str]:
    """Figures of AP and IoU of each class over the non-empty rows of a table by condition.

    Args:
        key: Name of the condition.
        boxes: Detection figures by the condition's value.
        cells: Segmentation figures by the condition's value.
    """
    boxes = {_short(name): row for name, row in boxes.items() if row["boxes"]}
    cells = {_short(name): row for name, row in cells.items() if row["frames"]}
    joined = key not in _UNORDERED
    for method in measured_methods(boxes.values()):
        classes = [name for name in BOX_CLASSES if any(name in row["classes"] for row in boxes.values())]
        values = {
            name: [row["classes"].get(name, {}).get(method, {}).get("AP") for row in boxes.values()] for name in classes
        }
        yield _profile(f"AP, matched by {METHOD_NAMES[method]}", "AP", [*boxes], values, joined=joined)
    if cells:
        classes = [*next(iter(cells.values()))["IoU_at"]]
        values = {name: [at_table_threshold(row["IoU_at"][name]) for row in cells.values()] for name in classes}
        yield _profile("Bird's-eye-view IoU", "IoU", [*cells], values, joined=joined)


def cell_figures(segmentation: Figures) -> Iterator[str]:
    """Figure of the bird's-eye-view IoU of each class over the score thresholds."""
    values = {name: [*own.values()] for name, own in segmentation["IoU_at"].items()}
    yield _profile("IoU by threshold of the score", "IoU", [*segmentation["mean_IoU_at"]], values, joined=True)


def _profile(
    title: str, y_label: str, names: Sequence[str], values: Mapping[str, Iterable[float | None]], *, joined: bool
) -> str:
    series = [Series(words(name), _numbers(own), chart_color(name)) for name, own in values.items()]
    return figure(title, share_profile(names, series, y_label, joined=joined))


def profile_colors(boxes: Figures, cells: Figures) -> dict[str, Color]:
    """Colors of the classes in detection and segmentation figures of several rows, by displayed name."""
    known = {name for row in boxes.values() for name in row.get("classes", ())}
    known |= {name for row in cells.values() for name in row.get("IoU_at", ())}
    ordered = dict.fromkeys((*BOX_CLASSES, *BEV_CLASSES))
    return {words(name): chart_color(name) for name in ordered if name in known}


def _short(name: str) -> str:
    """A shortened row name, so that many fit side by side."""
    return name.replace(" to ", "–").replace(" and more", " +")


def _numbers(values: Iterable[float | None]) -> Float64Array:
    return np.array([np.nan if value is None else value for value in values])
