"""Draws charts of shares in 0..1 as SVG text: curves over another share, and profiles over named categories."""

from collections.abc import Sequence

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.show.reports.svg_charts import Axes, Series
from simbev_ros.show.reports.svg_drawing import Drawing, Size

_DOT_RADIUS = 3.2


def share_lines(lines: Sequence[tuple[Float64Array, Series]], x_label: str, y_label: str, size: Size) -> str:
    """Line chart of shares over shares: (N,) x and the series of each line; NaN is a gap."""
    axes = Axes(Drawing(*size), (0.0, 1.0), (0.0, 1.0), min_step_y=0.0)
    axes.draw_frame(x_label, y_label)
    for x, each in lines:
        axes.draw_curve(x, each, np.isfinite(each.values) & np.isfinite(x))
    return axes.drawing.svg()


def share_profile(
    names: Sequence[str], series: Sequence[Series], y_label: str, size: Size, *, joined: bool = True
) -> str:
    """Chart of dots over (N,) names, joined by lines if the names are ordered; NaN is a gap."""
    axes = Axes(Drawing(*size), (0.0, float(len(names))), (0.0, 1.0), min_step_y=0.0)
    axes.draw_frame("", y_label, names)
    middles = np.arange(len(names), dtype=np.float64) + 0.5
    for each in series:
        known = np.isfinite(each.values)
        if joined:
            axes.draw_curve(middles, each, known)
        for index in np.flatnonzero(known).tolist():
            value = float(each.values[index])
            title = f"{each.name}, {names[index]}: {value:.3f}"
            axes.drawing.dot(*axes.to_sheet(float(middles[index]), value), each.color, title, _DOT_RADIUS)
    return axes.drawing.svg()
