"""Charts of shares, 0 … 1, as SVG text: lines over places, and over names."""

from collections.abc import Sequence

import numpy as np

from simbev_ros.types import Float64Array
from simbev_ros.viz.reports.svg_charts import Axes, Series
from simbev_ros.viz.reports.svg_drawing import Drawing, Size

_DOT = 3.2


def share_lines(lines: Sequence[tuple[Float64Array, Series]], x_label: str, y_label: str, size: Size) -> str:
    """Lines of (N,) shares over (N,) shares, those of each series; NaN is a gap."""
    axes = Axes(Drawing(*size), (0.0, 1.0), (0.0, 1.0), least_step_y=0.0)
    axes.frame(x_label, y_label)
    for x, each in lines:
        axes.curve(x, each, np.isfinite(each.values) & np.isfinite(x))
    return axes.drawing.svg()


def share_profile(
    names: Sequence[str], series: Sequence[Series], y_label: str, size: Size, *, joined: bool = True
) -> str:
    """Dots over (N,) names, joined by lines if their order means something; NaN is a gap."""
    axes = Axes(Drawing(*size), (0.0, float(len(names))), (0.0, 1.0), least_step_y=0.0)
    axes.frame("", y_label, names)
    middles = np.arange(len(names), dtype=np.float64) + 0.5
    for each in series:
        known = np.isfinite(each.values)
        if joined:
            axes.curve(middles, each, known)
        for index in np.flatnonzero(known).tolist():
            value = float(each.values[index])
            title = f"{each.name}, {names[index]}: {value:.3f}"
            axes.drawing.dot(*axes.at(float(middles[index]), value), each.color, title, _DOT)
    return axes.drawing.svg()
