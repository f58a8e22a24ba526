"""Figures of a dataset's page about the ground: classes of the bird's-eye view, and the scenes' locations on the maps.

A dataset's ``Statistics`` enter; HTML figures with charts leave.
"""

from collections.abc import Iterator, Mapping, Sequence

import cv2
import numpy as np

from simbev_ros.dataset.statistics import SceneFacts, Statistics
from simbev_ros.dataset.tallies import CELL_M
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray, Int64Array
from simbev_ros.schema.palette import class_color
from simbev_ros.show.pages.charts import SMALL_PX, Chart, Series, bars, figure, heat_map
from simbev_ros.show.pages.plans import Square
from simbev_ros.show.pages.scene_figures import SPLIT_COLORS
from simbev_ros.show.reports.page import words
from simbev_ros.show.reports.svg_drawing import Color, css, number

_MAX_CELLS = 120
_MAP_PIXELS = 280
_MAP_PX = 620
_VISITED: Color = (96, 110, 120)
_MARGIN_M, _MIN_SIDE_M = 60.0, 300.0
_MAX_COLOR_SUM = 480


def cover_figures(statistics: Statistics) -> Iterator[str]:
    """Figures of the share of bird's-eye-view cells that each class covers, and of the frames that contain it."""
    tally = statistics.tally
    if tally.bev is not None:
        frames = int(tally.counts["bev_frames"])
        names = [words(name) for name in BEV_CLASSES]
        share = 100.0 * tally.bev.mean(axis=(1, 2)) / frames
        yield figure("Cells that a class covers", bars(names, [Series("cells", share)], " %"))
        present = 100.0 * tally.counts["bev_present"] / frames
        yield figure("Frames that have a class", bars(names, [Series("frames", present)], " %"))


def grid_figures(statistics: Statistics) -> Iterator[str]:
    """Figures of the positions of each class in the bird's-eye view."""
    tally, grids = statistics.tally, statistics.tally.bev
    for name, counts in zip(BEV_CLASSES, grids, strict=True) if grids is not None else ():
        percent = 100.0 * counts / int(tally.counts["bev_frames"])
        half_m = [size * tally.bev_cell_m / 2 for size in counts.shape]
        hover = "%{y:.0f} m ahead, %{x:.0f} m to the right: %{z:.1f} %"
        ends_m = (-half_m[1], half_m[1]), (-half_m[0], half_m[0])
        chart = heat_map(_shrink(percent)[::-1], *ends_m, hover, _darken(class_color(name)), SMALL_PX + 60)
        for axis, other in (("xaxis", {}), ("yaxis", {"scaleanchor": "x"})):
            chart.layout[axis] |= {"constrain": "domain", **other}
        chart.layout["annotations"] = [{"x": 0, "y": 0, "text": "▲", "showarrow": False}]
        yield figure(words(name).capitalize(), chart, f"at most in {number(float(percent.max()))} % of frames")


def square_of_map(statistics: Statistics, name: str) -> Square | None:
    """The square of a map that contains all paths of the ego; None if there are none."""
    paths_m = [scene.ego_m for scene in statistics.scenes if scene.map == name and len(scene.ego_m)]
    return Square.around(np.concatenate(paths_m), _MARGIN_M, _MIN_SIDE_M) if paths_m else None


def map_figures(statistics: Statistics, plans: Mapping[str, str]) -> Iterator[str]:
    """Figures of each map from above: the paths of the ego, and the positions of other actors.

    Args:
        statistics: The statistics.
        plans: Addresses of the pictures of the maps' ``square_of_map``; maps without roads are left out.
    """
    for name, cells in statistics.visited.items():
        if (square := square_of_map(statistics, name)) is not None:
            scenes = [scene for scene in statistics.scenes if scene.map == name and len(scene.ego_m)]
            note = "" if name in plans else "The roads of this map could not be built."
            yield figure(name, _map(cells, scenes, square, plans.get(name, "")), note)


def _map(cells: Int64Array, scenes: Sequence[SceneFacts], square: Square, plan: str) -> Chart:
    """Chart of a map: cells in which other actors were, and the paths of the ego, each starting at a dot."""
    low_m = square.center_m - square.side_m / 2
    visited = _raster((cells + 0.5) * CELL_M - low_m, square.side_m)
    x, y = ((low, low + square.side_m) for low in low_m.tolist())
    others = heat_map((visited > 0).astype(np.float32), x, y, "", _VISITED).data[0]
    split_seen: set[str] = set()
    data = [
        others
        | {"opacity": 0.35, "hoverinfo": "skip", "hovertemplate": None, "showlegend": True, "name": "other actors"}
    ]
    for scene in scenes:
        color, positions = css(SPLIT_COLORS[scene.split]), np.round(scene.ego_m, 1).tolist()
        data.append(
            {
                "type": "scatter",
                "mode": "lines+markers",
                "x": [position[0] for position in positions],
                "y": [position[1] for position in positions],
                "name": scene.split,
                "legendgroup": scene.split,
                "showlegend": scene.split not in split_seen,
                "text": f"{scene.name}, {scene.split}",
                "hovertemplate": "%{text}<extra></extra>",
                "line": {"color": color, "width": 4},
                "marker": {"color": color, "size": [10] + [0] * (len(positions) - 1)},
            }
        )
        split_seen.add(scene.split)
    return Chart("Map", data, {**square.layout(_MAP_PX, plan), "showlegend": True})


def _raster(positions_m: AnyArray, extent_m: float) -> AnyArray:
    """(P, P) number of (K, 2) positions in each cell of a square of side ``extent_m``; row 0 is at y = 0."""
    pixels = int(min(_MAP_PIXELS, np.ceil(extent_m / CELL_M)))
    column, row = np.floor(positions_m / extent_m * pixels).astype(int).T
    is_inside = (column >= 0) & (column < pixels) & (row >= 0) & (row < pixels)
    raster = np.zeros((pixels, pixels))
    np.add.at(raster, (row[is_inside], column[is_inside]), 1.0)
    return raster


def _shrink(values: AnyArray) -> AnyArray:
    """(h, w) values averaged to at most ``_MAX_CELLS`` rows and columns."""
    rows, columns = values.shape
    share = min(1.0, _MAX_CELLS / max(rows, columns))
    size = max(1, round(columns * share)), max(1, round(rows * share))
    return np.asarray(cv2.resize(values.astype(np.float32), size, interpolation=cv2.INTER_AREA))


def _darken(color: Color) -> Color:
    """The color, darkened if necessary to stand out from the paper."""
    if sum(color) <= _MAX_COLOR_SUM:
        return color
    red, green, blue = (round(part * _MAX_COLOR_SUM / sum(color)) for part in color)
    return red, green, blue
