"""Builds the page that shows simulated sensors beside real ones: a table and curves for each sensor."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import numpy as np

from simbev_ros.evaluation.realism.comparison import KINDS, Row
from simbev_ros.evaluation.realism.samples import Sample
from simbev_ros.evaluation.realism.statistics import Curve, curves_of
from simbev_ros.foundation.files.whole_files import write_whole
from simbev_ros.show.pages.charts import Series, curves, figure
from simbev_ros.show.pages.web_page import web_page
from simbev_ros.show.reports.page import key_figures, legend, section, sheet, table
from simbev_ros.show.reports.svg_drawing import INK, Color

_REAL: tuple[Color, ...] = (
    (201, 120, 40),
    (120, 150, 60),
    (150, 80, 150),
    (110, 110, 110),
    (190, 90, 90),
    (70, 150, 150),
)
_NOTE = "A row is marked where ours lies outside the span of the single real samples by more than a tenth."


def write_realism_report(
    path: Path, rows: Sequence[Row], ours: Mapping[str, Sequence[Sample]], real: Mapping[str, Sequence[Sample]]
) -> None:
    """Write the page.

    Args:
        path: The HTML file.
        rows: The figures of both.
        ours: Samples of each sensor of ours that the rows are about, and of others.
        real: Samples of each real sensor.
    """
    sensors = list(dict.fromkeys(row.sensor for row in rows))
    drawn = {name: curves_of(samples) for name, samples in real.items()}
    kinds = {name: KINDS[type(samples[0])] for name, samples in real.items()}
    sections = []
    for sensor in sensors:
        kind = KINDS[type(ours[sensor][0])]
        others = {name: drawn[name] for name in real if kinds[name] == kind}
        of_sensor = [row for row in rows if row.sensor == sensor]
        body = _table(of_sensor) + _charts(sensor, curves_of(ours[sensor]), others)
        sections.append(section(sensor, body, _NOTE if sensor == sensors[0] else ""))
    inside = sum(row.is_inside for row in rows)
    head = key_figures([(f"{inside} of {len(rows)}", "figures in the span of real samples")])
    page = web_page("Simulated and real sensors", head, "".join(sections), ["charts.js"], is_single=True)
    write_whole(path, page.encode())


def _table(rows: Sequence[Row]) -> str:
    names = list(dict.fromkeys(name for row in rows for name in row.real))
    lines = []
    for row in rows:
        mark = "" if row.is_inside else ' class="lacking"'
        values = "".join(f"<td>{_number(row.real.get(name))}</td>" for name in names)
        lines.append(f"<th>{escape(row.figure)}</th><td{mark}>{_number(row.ours)}</td>{values}")
    return table(["", "ours", *names], lines)


def _charts(sensor: str, ours: Mapping[str, Curve], real: Mapping[str, Mapping[str, Curve]]) -> str:
    colors = {name: _REAL[index % len(_REAL)] for index, name in enumerate(real)}
    figures = []
    for title, curve in ours.items():
        series = [Series(name, each[title].y, colors[name]) for name, each in real.items()]
        series.append(Series(sensor, curve.y, INK))
        chart = curves(curve.x, series, curve.x_label, curve.y_label, is_log=curve.is_log)
        figures.append(figure(title, chart))
    return legend({sensor: INK, **colors}) + sheet("pair", figures)


def _number(value: float | None) -> str:
    return "" if value is None or not np.isfinite(value) else f"{value:.4g}"
