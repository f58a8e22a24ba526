"""Figures of a dataset report about its boxes: counts, positions, sizes, and how well sensors see them.

A dataset's ``Statistics`` enter; HTML figures with charts leave.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from simbev_ros.dataset.statistics import Statistics
from simbev_ros.dataset.tallies import (
    DISTANCE_STEP_M,
    POINT_LEVELS,
    POSITION_BINS,
    POSITION_STEP_M,
    SIZE_STEP_M,
    SPEED_STEP_MPS,
    VISIBILITIES,
)
from simbev_ros.foundation.semantics import BOX_CLASSES, CLASSES, DIFFICULTIES, MOVING_CLASSES
from simbev_ros.foundation.types import Int64Array
from simbev_ros.schema.palette import class_color
from simbev_ros.show.pages.charts import (
    SMALL_PX,
    WIDE_PX,
    Chart,
    Series,
    axis_title,
    bars,
    curves,
    figure,
    heat_map,
    histogram,
)
from simbev_ros.show.reports.page import words
from simbev_ros.show.reports.svg_drawing import Color, number

_PALE: Color = (203, 213, 219)
_DIFFICULTY_COLORS: tuple[Color, ...] = ((126, 184, 138), (226, 178, 84), (196, 84, 74))
_ON_WHEELS = tuple(name for name in MOVING_CLASSES if CLASSES[name]["moves"] != "feet")
_COLUMNS = 24
_RINGS_M = (40, 80, 120)
_RING = {"color": "rgba(128,128,128,0.7)", "width": 1, "dash": "dot"}
_SQUARE_PX = 520


def box_figures(statistics: Statistics) -> Iterator[str]:
    """Figures of the boxes' number by class, distance, visibility, difficulty, position and sensor points."""
    counts, frames = statistics.tally.counts, max(statistics.tally.labeled_frames, 1)
    colors = {name: class_color(name) for name in BOX_CLASSES if counts["boxes"][BOX_CLASSES.index(name)]}
    rows = [BOX_CLASSES.index(name) for name in colors]
    names = [words(name) for name in colors]
    valid, boxes = counts["valid"][rows] / frames, counts["boxes"][rows] / frames
    parts = [Series("valid", valid), Series("not valid", boxes - valid, _PALE)]
    note = "Valid: at least one point of a lidar or radar is inside."
    yield figure("Boxes a frame, by class", bars(names, parts), note)
    together = histogram([Series("frames", _merge_bins(counts["all_per_frame"], 4))], 4, "boxes", "frames")
    yield figure("Boxes in a frame, all classes", together)

    def stacked(name: str) -> list[Series]:
        return [Series(words(BOX_CLASSES[row]), counts[name][row], class_color(BOX_CLASSES[row])) for row in rows]

    yield figure("Distance from the ego", histogram(stacked("distance"), DISTANCE_STEP_M, "m", "boxes"))
    visible = histogram(stacked("visibility"), 100 / VISIBILITIES, "% of its pixels", "boxes")
    unseen = int(counts["unseen"].sum())
    yield figure("Visibility in the cameras", visible, f"{number(unseen)} boxes are in no camera's picture.")
    colors_of = dict(zip(DIFFICULTIES, _DIFFICULTY_COLORS, strict=True))
    grades = [
        Series(name, counts["difficulty"][rows, k] / frames, colors_of[name]) for k, name in enumerate(DIFFICULTIES)
    ]
    yield figure("Difficulty, boxes a frame", bars(names, grades))
    yield _position_figure(counts["places"], _ON_WHEELS, "Where vehicles are")
    yield _position_figure(counts["places"], ("pedestrian",), "Where pedestrians are")
    for kind in ("lidar", "radar"):
        if counts[f"{kind}_points"].any():
            yield from _point_figures(
                counts[f"{kind}_boxes"], counts[f"{kind}_points"], counts[f"{kind}_levels"], kind, rows
            )


def crowd_figures(statistics: Statistics) -> Iterator[str]:
    """Figures of the number of boxes in a frame, one for each class."""
    for name, counts in zip(BOX_CLASSES, statistics.tally.counts["per_frame"], strict=True):
        if counts[1:].any():
            maximum = int(np.flatnonzero(counts).max())
            step = maximum // _COLUMNS + 1
            series = Series("frames", _merge_bins(counts, step), class_color(name))
            yield figure(
                f"{words(name).capitalize()}: boxes in a frame",
                histogram([series], step, "boxes", "", height_px=SMALL_PX),
            )


def size_figures(statistics: Statistics) -> Iterator[str]:
    """Figures of speeds and sizes, for each class."""
    counts = statistics.tally.counts
    for name in BOX_CLASSES:
        row, color = BOX_CLASSES.index(name), class_color(name)
        if not counts["boxes"][row]:
            continue
        if name in MOVING_CLASSES:
            chart = histogram(
                [Series("boxes", counts["speed"][row], color)], SPEED_STEP_MPS, "m/s", "", height_px=SMALL_PX
            )
            yield figure(f"{words(name).capitalize()}: speed", chart)
        for axis, side in enumerate(("length", "width", "height")):
            series = Series("boxes", counts["size"][axis, row], color)
            yield figure(
                f"{words(name).capitalize()}: {side}", histogram([series], SIZE_STEP_M, "m", "", height_px=SMALL_PX)
            )


def _point_figures(
    boxes: Int64Array, points: Int64Array, levels: Int64Array, kind: str, rows: Sequence[int]
) -> Iterator[str]:
    """Figures of sensor points in a box over distance, for one kind of sensor."""
    middles_m = (np.arange(boxes.shape[1], dtype=np.float64) + 0.5) * DISTANCE_STEP_M
    mean = points / np.maximum(boxes, 1)
    series = [Series(words(BOX_CLASSES[row]), mean[row], class_color(BOX_CLASSES[row])) for row in rows]
    mean_chart = curves(middles_m, series, "m", "points", is_log=True)
    yield figure(f"{kind.capitalize()} points in a box, mean", mean_chart)
    used = int(np.flatnonzero(levels.sum(axis=1)).max(initial=0)) + 1
    top = int(np.flatnonzero(levels.sum(axis=0)).max(initial=0)) + 1
    yield figure(f"{kind.capitalize()} points in a box: how often, at each distance", _level_heat(levels[:used, :top]))


def _level_heat(levels: Int64Array) -> Chart:
    """Heat map of the number of points in a box: distance to the right, points upward, in doubling steps."""
    used, top = levels.shape
    percent = 100.0 * levels / np.maximum(levels.sum(axis=1, keepdims=True), 1)
    hover = "%{x} m: %{z:.0f} % of boxes"
    chart = heat_map(percent.T, (0.0, used * DISTANCE_STEP_M), (0.0, float(top)), hover, height_px=WIDE_PX)
    names = ["0", *(str(1 << k) for k in range(POINT_LEVELS - 1))][:top:2]
    ticks = {"tickvals": [k + 0.5 for k in range(0, top, 2)], "ticktext": names}
    chart.layout["xaxis"] |= {"title": axis_title("m")}
    chart.layout["yaxis"] |= {"title": axis_title("points, from"), **ticks}
    chart.layout["margin"] |= {"l": 52, "b": 50}
    return chart


def _position_figure(positions: Int64Array, names: Sequence[str], title: str) -> str:
    """Figure of the positions of boxes of some classes around the ego, which faces up."""
    values, half_m = (
        positions[[BOX_CLASSES.index(name) for name in names]].sum(axis=0),
        POSITION_BINS * POSITION_STEP_M / 2,
    )
    ends_m = (-half_m, half_m)
    hover = "%{y} m ahead, %{x} m to the right: %{z} boxes"
    chart = heat_map(values[::-1], ends_m, ends_m, hover, class_color(names[0]), _SQUARE_PX)
    rings = [{"type": "circle", "x0": -r, "x1": r, "y0": -r, "y1": r, "line": _RING} for r in _RINGS_M]
    chart.layout["shapes"] = rings
    chart.layout["annotations"] = [{"x": 0, "y": 0, "text": "▲", "showarrow": False}]
    chart.layout["xaxis"] |= {"title": axis_title("m to the right"), "constrain": "domain"}
    chart.layout["yaxis"] |= {"title": axis_title("m ahead"), "scaleanchor": "x", "constrain": "domain"}
    chart.layout["margin"] |= {"l": 52, "b": 50}
    return figure(title, chart, "The ego is in the middle and faces up.")


def _merge_bins(counts: Int64Array, by: int) -> Int64Array:
    """Counts of bins that are ``by`` times as wide."""
    return np.add.reduceat(counts, np.arange(0, len(counts), by))
