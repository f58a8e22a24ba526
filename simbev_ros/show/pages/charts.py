"""Charts that Plotly draws in the browser: series of numbers enter, figures of HTML with the data as JSON leave."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np

from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.show.pages.web_page import json_block
from simbev_ros.show.reports.svg_drawing import INK, Color, css, number

WIDE_PX, SMALL_PX = 280, 190
"""Heights of charts in wide and narrow columns."""

_TOP_SHARE = 0.998
_MARGIN = {"l": 48, "r": 12, "t": 10, "b": 50}
_LEGEND = {"traceorder": "normal", "orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0}
_ROW_PX = 22
_SHARES: dict[str, Any] = {"range": [0.0, 1.03], "dtick": 0.25}


@dataclass(frozen=True, slots=True)
class Series:
    """A named series of (N,) values, one for each bin, bar or point, with its color."""

    name: str
    values: AnyArray
    color: Color = INK


@dataclass(frozen=True, slots=True)
class Chart:
    """A chart in Plotly's terms.

    Attributes:
        kind: What it is, as read aloud, such as ``Histogram``.
        data: Plotly's traces.
        layout: Plotly's layout.
        attributes: HTML attributes that tie the chart to a video.
    """

    kind: str
    data: Sequence[dict[str, Any]]
    layout: dict[str, Any]
    attributes: dict[str, str] = field(default_factory=dict)


def figure(title: str, chart: Chart, note: str = "") -> str:
    """HTML of a chart with its title and, below that, a note as text."""
    said = f'<p class="note">{escape(note)}</p>' if note else ""
    tied = "".join(f' {name}="{escape(value)}"' for name, value in chart.attributes.items())
    layout = {"margin": _MARGIN, "showlegend": len(chart.data) > 1, "legend": _LEGEND, **chart.layout}
    if layout["showlegend"]:
        layout["margin"] = {**layout["margin"], "t": 34}
    plot = f'<div class="plot" style="height:{layout["height"]}px"></div>'
    return (
        f"<figure><figcaption>{escape(title)}</figcaption>{said}"
        f'<div class="chart" role="img" aria-label="{escape(f"{chart.kind}: {title}")}"{tied}>'
        f"{plot}{json_block({'data': chart.data, 'layout': layout})}</div></figure>"
    )


def histogram(
    series: Sequence[Series],
    step: float,
    x_label: str,
    y_label: str,
    start: float = 0.0,
    height_px: int = WIDE_PX,
    min_bins: int = 2,
) -> Chart:
    """Histogram with the columns of several series stacked; empty bins at the end are cut off.

    Args:
        series: Values of the bins.
        step: Width of a bin.
        x_label: Quantity of the bins, mostly a unit.
        y_label: What is counted.
        start: Lower edge of the first bin.
        height_px: Height of the chart.
        min_bins: Minimum number of bins to show, even if they are empty.
    """
    total = np.add.reduce([np.asarray(each.values, np.float64) for each in series])
    used = max(int(np.flatnonzero(total).max(initial=0)) + 1, min_bins)
    low = start + step * np.arange(min(used, len(total)))
    ranges = [f"{a:g}–{a + step:g} {x_label}" for a in low.tolist()]
    data = [
        _bar(each, x=(low + step / 2).tolist(), y=_rounded(each.values[: len(low)]))
        | {"width": step * 0.94, "customdata": ranges, "hovertemplate": "%{customdata}: %{y}"}
        for each in series
        if np.any(each.values)
    ]
    x_axis = {"title": axis_title(x_label), "range": [start, start + used * step]}
    layout = {"barmode": "stack", "height": height_px, "xaxis": x_axis, "yaxis": {"title": axis_title(y_label)}}
    return Chart("Histogram", data, layout)


def bars(labels: Sequence[str], series: Sequence[Series], unit: str = "") -> Chart:
    """Bar chart with one horizontal bar for each label; several series are stacked, and their sum is written."""
    total = np.add.reduce([np.asarray(each.values, np.float64) for each in series])
    shown = list(labels)
    hover = {"hovertemplate": f"%{{y}}: %{{x}}{unit}"}
    data: list[dict[str, Any]] = [
        {**_bar(each, x=_rounded(each.values), y=shown), **hover, "orientation": "h"} for each in series
    ]
    sums = {"type": "scatter", "mode": "text", "x": _rounded(total), "y": shown, "cliponaxis": False}
    texts = [f" {number(value)}{unit}" for value in total.tolist()]
    data.append({**sums, "text": texts, "textposition": "middle right", "hoverinfo": "skip", "showlegend": False})
    layout = {
        "barmode": "stack",
        "bargap": 0.3,
        "height": _ROW_PX * len(shown) + (70 if len(series) > 1 else 40),
        "showlegend": len(series) > 1,
        "margin": {**_MARGIN, "r": 70, "b": 28},
        "xaxis": {"rangemode": "tozero"},
        "yaxis": {"autorange": "reversed", "type": "category", "ticksuffix": "  "},
    }
    return Chart("Bar chart", data, layout)


def curves(
    x: Float64Array,
    series: Sequence[Series],
    x_label: str,
    y_label: str,
    *,
    is_log: bool = False,
    height_px: int = WIDE_PX,
    over_time: bool = False,
) -> Chart:
    """Lines over (N,) x.

    Args:
        x: Positions of the values; NaN values are gaps.
        series: Values of each line.
        x_label: Quantity of x.
        y_label: Quantity of the values.
        is_log: Whether the y axis is logarithmic; values that are not positive are gaps then.
        height_px: Height of the chart.
        over_time: Whether x is the time of the page's video, which moves a mark along it.
    """
    known = [np.isfinite(each.values) & ((each.values > 0) | (not is_log)) for each in series]
    last = max((int(np.flatnonzero(each).max(initial=0)) for each in known), default=0) + 1
    data = [
        {
            "type": "scatter",
            "mode": "lines" if last > 1 else "markers",
            "name": each.name,
            "x": _rounded(x[:last]),
            "y": [value if ok else None for value, ok in zip(_rounded(each.values[:last]), there, strict=False)],
            "line": {"color": css(each.color), "width": 2},
            "hovertemplate": f"%{{x}} {x_label}: %{{y}}",
        }
        for each, there in zip(series, known, strict=True)
        if there.any()
    ]
    y_axis = {"title": axis_title(y_label), "type": "log" if is_log else "linear"}
    layout = {"height": height_px, "xaxis": {"title": axis_title(x_label)}, "yaxis": y_axis}
    if not is_log:
        y_axis["rangemode"] = "tozero"
    return Chart("Line chart", data, layout, {"data-clock": "axis"} if over_time else {})


def share_lines(lines: Sequence[tuple[Float64Array, Series]], x_label: str, y_label: str, height_px: int) -> Chart:
    """Lines of shares in 0..1 over shares, each over its own (N,) x; NaN is a gap. The legend is left to the page."""
    data = [
        {
            "type": "scatter",
            "mode": "lines" if len(x) > 1 else "markers",
            "name": each.name,
            "x": _rounded(x),
            "y": _rounded(each.values),
            "line": {"color": css(each.color), "width": 2},
            "hovertemplate": f"{x_label} %{{x:.3f}}: {y_label} %{{y:.3f}}",
        }
        for x, each in lines
    ]
    axes = {"xaxis": {**_SHARES, "title": axis_title(x_label)}, "yaxis": {**_SHARES, "title": axis_title(y_label)}}
    return Chart("Line chart", data, {"height": height_px, "showlegend": False, **axes})


def share_profile(
    names: Sequence[str], series: Sequence[Series], y_label: str, height_px: int = WIDE_PX - 30, *, joined: bool = True
) -> Chart:
    """Dots of shares in 0..1 over (N,) names, joined if the names are ordered. The legend is left to the page."""
    data = [
        {
            "type": "scatter",
            "mode": "lines+markers" if joined else "markers",
            "name": each.name,
            "x": list(names),
            "y": _rounded(each.values),
            "line": {"color": css(each.color), "width": 2},
            "marker": {"color": css(each.color), "size": 7},
            "cliponaxis": False,
            "hovertemplate": "%{x}: %{y:.3f}",
        }
        for each in series
    ]
    axes = {"xaxis": {"type": "category"}, "yaxis": {**_SHARES, "title": axis_title(y_label)}}
    layout = {"height": height_px, "showlegend": False, "margin": {**_MARGIN, "b": 28}, **axes}
    return Chart("Profile", data, layout)


def heat_map(
    values: AnyArray,
    x: tuple[float, float],
    y: tuple[float, float],
    hover: str,
    color: Color = INK,
    height_px: int = SMALL_PX,
) -> Chart:
    """Heat map of (H, W) values ≥ 0, transparent where they are 0; row 0 is at the lower edge.

    The top 0.2 % of values, such as at the ego's own position, saturate.

    Args:
        values: The values.
        x: Values at the left and right edge.
        y: Values at the lower and upper edge.
        hover: What is shown under the pointer, in Plotly's notation.
        color: Color of the highest values.
        height_px: Height of the chart.
    """
    rows, columns = values.shape
    top = float(np.quantile(values, _TOP_SHARE)) or float(values.max()) or 1.0
    red, green, blue = color
    scale = [[share**2, f"rgba({red},{green},{blue},{share:g})"] for share in np.linspace(0, 1, 6).round(2).tolist()]
    (x0, x1), (y0, y1) = x, y
    dx, dy = (x1 - x0) / columns, (y1 - y0) / rows
    trace = {"type": "heatmap", "z": typed_array(values), "zmin": 0, "zmax": top, "colorscale": scale}
    place = {"x0": x0 + dx / 2, "dx": dx, "y0": y0 + dy / 2, "dy": dy}
    layout = {
        "height": height_px,
        "margin": {**_MARGIN, "t": 8, "b": 26, "l": 36},
        "xaxis": {"range": list(x), "showgrid": False, "zeroline": False},
        "yaxis": {"range": list(y), "showgrid": False, "zeroline": False},
    }
    return Chart(
        "Heat map", [{**trace, **place, "showscale": False, "hovertemplate": f"{hover}<extra></extra>"}], layout
    )


def typed_array(values: AnyArray) -> dict[str, str]:
    """(H, W) numbers as float32 in Plotly's compact form."""
    data = np.ascontiguousarray(values, "<f4")
    shape = ", ".join(map(str, data.shape))
    return {"dtype": "f4", "bdata": base64.b64encode(data.tobytes()).decode(), "shape": shape}


def axis_title(text: str) -> dict[str, Any]:
    """Title of an axis, close to its ticks."""
    return {"text": text, "standoff": 6}


def _bar(series: Series, x: Sequence[Any], y: Sequence[Any]) -> dict[str, Any]:
    return {"type": "bar", "name": series.name, "x": x, "y": y, "marker": {"color": css(series.color)}}


def _rounded(values: AnyArray) -> list[float | None]:
    """Values with six significant digits; None for those that are not finite."""
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in np.asarray(values, np.float64).tolist()]
