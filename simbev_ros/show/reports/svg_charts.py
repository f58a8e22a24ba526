"""Axes and curves of charts as SVG text for HTML pages without scripts, whose style sheet formats text and lines.

Series of numbers enter; SVG text leaves. Every mark has a title, which browsers show under the pointer.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array
from simbev_ros.show.reports.svg_drawing import INK, Color, Drawing, css, number, ticks

_LEFT, _RIGHT, _TOP, _BOTTOM = 46.0, 10.0, 22.0, 34.0


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
        y: Values at the lower and upper edge.
        min_step_y: Minimum step between ticks of the y axis.
    """

    drawing: Drawing
    x: tuple[float, float]
    y: tuple[float, float]
    min_step_y: float = 1.0

    def to_sheet(self, x: float, y: float) -> tuple[float, float]:
        """Position of a value on the sheet."""
        across, up = (x - self.x[0]) / (self.x[1] - self.x[0]), (y - self.y[0]) / (self.y[1] - self.y[0])
        width, height = self.drawing.width - _LEFT - _RIGHT, self.drawing.height - _TOP - _BOTTOM
        return _LEFT + across * width, _TOP + (1.0 - up) * height

    def draw_frame(self, x_label: str, y_label: str, x_names: Sequence[str] = ()) -> None:
        """Draw the grid, ticks and axis labels; ``x_names`` replace the numbers of the x axis, each at index + 0.5."""
        sheet = self.drawing
        for value in ticks(*self.y, min_step=self.min_step_y):
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
