"""Draws histograms, bar charts and curves as SVG text for HTML pages, whose style sheet formats text and lines.

Series of numbers enter; SVG text leaves. Every mark has a title, which browsers show under the pointer.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from simbev_ros.types import AnyArray, BoolArray, Float64Array
from simbev_ros.viz.reports.svg_drawing import INK, Color, Drawing, Size, css, number, ticks

WIDE: Size = (560.0, 250.0)
SMALL: Size = (270.0, 150.0)

_LEFT, _RIGHT, _TOP, _BOTTOM = 46.0, 10.0, 22.0, 34.0
_MIN_COLUMN_GAP = 0.6
_MIN_LOG = 0.01


@dataclass(frozen=True, slots=True)
class Series:
    """A named series of (N,) values, one for each bin, bar or point, with its color."""

    name: str
    values: AnyArray
    color: Color = INK


@dataclass(frozen=True, slots=True)
class Axes:
    """The plot area of a drawing and the values at its edges.

    Attributes:
        drawing: The sheet.
        x: Values at the left and right edge.
        y: Values at the lower and upper edge; positive with ``log_y``.
        log_y: Whether the y axis is logarithmic.
        min_step_y: Minimum step between ticks of the y axis.
    """

    drawing: Drawing
    x: tuple[float, float]
    y: tuple[float, float]
    log_y: bool = False
    min_step_y: float = 1.0

    def to_sheet(self, x: float, y: float) -> tuple[float, float]:
        """Position of a value on the sheet."""
        low, high = (math.log10(end) if self.log_y else end for end in self.y)
        level = math.log10(max(y, self.y[0])) if self.log_y else y
        across, up = (x - self.x[0]) / (self.x[1] - self.x[0]), (level - low) / (high - low)
        width, height = self.drawing.width - _LEFT - _RIGHT, self.drawing.height - _TOP - _BOTTOM
        return _LEFT + across * width, _TOP + (1.0 - up) * height

    def draw_frame(self, x_label: str, y_label: str, x_names: Sequence[str] = ()) -> None:
        """Draw the grid, ticks and axis labels; ``x_names`` replace the numbers of the x axis, each at index + 0.5."""
        sheet = self.drawing
        for value in _decades(*self.y) if self.log_y else ticks(*self.y, min_step=self.min_step_y):
            _, y = self.to_sheet(self.x[0], value)
            sheet.line(_LEFT, y, sheet.width - _RIGHT, y)
            sheet.text(_LEFT - 6, y + 3.5, number(value), anchor="end")
        floor = sheet.height - _BOTTOM
        sheet.line(_LEFT, floor, sheet.width - _RIGHT, floor, "axis")
        labels = {index + 0.5: name for index, name in enumerate(x_names)} or {v: number(v) for v in ticks(*self.x)}
        for value, name in labels.items():
            x, _ = self.to_sheet(value, self.y[0])
            sheet.text(x, floor + 14, name)
        sheet.text(sheet.width - _RIGHT, sheet.height - 5, x_label, "label", "end")
        sheet.text(0, 10, y_label, "label", "start")

    def draw_curve(self, x: Float64Array, each: Series, known: BoolArray) -> None:
        """Draw a line through (N,) points, with gaps where values are not known; a single point becomes a dot."""
        color, title = css(each.color), f"<title>{escape(each.name)}</title>"
        rows = np.flatnonzero(known)
        for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if len(rows) else ():
            points = [self.to_sheet(float(x[i]), float(each.values[i])) for i in run.tolist()]
            path = " ".join(f"{a:.1f},{b:.1f}" for a, b in points)
            self.drawing.add(f'<polyline class="curve" stroke="{color}" points="{path}">{title}</polyline>')
            if len(points) == 1:
                self.drawing.dot(*points[0], each.color, each.name)


def histogram(
    series: Sequence[Series],
    step: float,
    x_label: str,
    y_label: str,
    start: float = 0.0,
    size: Size = WIDE,
    min_bins: int = 2,
) -> str:
    """Histogram with the columns of several series stacked; empty bins at the end are cut off.

    Args:
        series: Values of the bins.
        step: Width of a bin.
        x_label: Quantity of the bins, mostly a unit.
        y_label: What is counted.
        start: Lower edge of the first bin.
        size: Width and height of the chart.
        min_bins: Minimum number of bins to show, even if they are empty.
    """
    total = _total(series)
    used = max(int(np.flatnonzero(total).max(initial=0)) + 1, min_bins)
    axes = Axes(Drawing(*size), (start, start + used * step), (0.0, float(total.max()) * 1.05 or 1.0))
    axes.draw_frame(x_label, y_label)
    base = np.zeros(used)
    for each in series:
        for index in np.flatnonzero(each.values[:used]).tolist():
            value, low = float(each.values[index]), float(base[index])
            x0, y0 = axes.to_sheet(start + index * step, low + value)
            x1, y1 = axes.to_sheet(start + (index + 1) * step, low)
            gap = min(_MIN_COLUMN_GAP, (x1 - x0) / 6.0)
            title = f"{each.name} {start + index * step:g}–{start + (index + 1) * step:g} {x_label}: {number(value)}"
            axes.drawing.block(x0 + gap, y0, x1 - x0 - 2 * gap, y1 - y0, each.color, title)
        base[: len(each.values)] += each.values[:used]
    return axes.drawing.svg()


def bars(labels: Sequence[str], series: Sequence[Series], unit: str = "", width: float = 560.0) -> str:
    """Bar chart with one horizontal bar for each label; several series are stacked."""
    total = _total(series)
    left, row, right = 14.0 + 6.9 * max(map(len, labels), default=1), 22.0, 70.0
    sheet = Drawing(width, row * len(labels) + 6)
    scale = (width - left - right) / (total.max(initial=0.0) or 1.0)
    for index, label in enumerate(labels):
        y, x = row * index + 4, left
        sheet.text(left - 8, y + 12.5, label, "name", "end")
        for each in series:
            length = float(each.values[index]) * scale
            sheet.block(x, y + 1, length, row - 7, each.color, f"{label}, {each.name}: {number(each.values[index])}")
            x += length
        sheet.text(x + 6, y + 12.5, f"{number(float(total[index]))}{unit}", "value", "start")
    return sheet.svg()


def curves(x: Float64Array, series: Sequence[Series], x_label: str, y_label: str, size: Size = WIDE) -> str:
    """Lines over (N,) x on a logarithmic y scale; values that are not positive are gaps, tiny ones are on the floor."""
    known = np.concatenate([np.zeros(0), *(each.values[each.values > 0] for each in series)])
    lowest, highest = float(known.min(initial=1.0)), float(known.max(initial=1.0))
    low, high = 10.0 ** math.floor(math.log10(max(lowest, _MIN_LOG))), 10.0 ** math.ceil(math.log10(highest) + 1e-9)
    seen = [int(np.flatnonzero(each.values > 0).max(initial=0)) for each in series]
    end = float(x[max(seen, default=0)])
    axes = Axes(Drawing(*size), (0.0, end or 1.0), (low, max(high, 10.0 * low)), log_y=True)
    axes.draw_frame(x_label, y_label)
    for each in series:
        axes.draw_curve(x, each, each.values > 0)
    return axes.drawing.svg()


def figure(title: str, chart: str, note: str = "") -> str:
    """HTML of a chart with its title and, below that, a note as text or as HTML."""
    caption = note if note.startswith("<") or not note else f'<p class="note">{escape(note)}</p>'
    return f"<figure><figcaption>{escape(title)}</figcaption>{caption}{chart}</figure>"


def words(name: str) -> str:
    """Name of a class as displayed text, with spaces."""
    return name.replace("_", " ")


def legend(series: Mapping[str, Color]) -> str:
    """HTML legend of names with their colors."""
    items = (f'<span><i style="background:{css(color)}"></i>{escape(name)}</span>' for name, color in series.items())
    return f'<p class="legend">{"".join(items)}</p>'


def _total(series: Sequence[Series]) -> Float64Array:
    """(N,) sums of all series."""
    return np.add.reduce([np.asarray(each.values, np.float64) for each in series])


def _decades(low: float, high: float) -> list[float]:
    return [10.0**k for k in range(round(math.log10(low)), round(math.log10(high)) + 1)]
