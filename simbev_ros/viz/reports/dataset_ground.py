"""Figures of a dataset report about the ground: classes of the bird's-eye view, and the scenes' locations on the maps.

A dataset's ``Statistics`` enter; HTML figures with SVG pictures leave.
"""

from collections.abc import Iterator, Sequence
from html import escape

import cv2
import numpy as np

from simbev_ros.dataset.statistics import SceneFacts, Statistics
from simbev_ros.dataset.tallies import CELL_M
from simbev_ros.palette import class_color
from simbev_ros.semantics import BEV_CLASSES
from simbev_ros.types import AnyArray, Int64Array
from simbev_ros.viz.reports.dataset_scenes import SPLIT_COLORS
from simbev_ros.viz.reports.svg_charts import SMALL, Series, bars, figure, legend, words
from simbev_ros.viz.reports.svg_drawing import Color, Drawing, css, heat, number, ramp, ticks

_MAX_PIXELS = 180
_MAP_PIXELS = 280
_MAP_SIDE = 560.0
_VISITED: Color = (176, 190, 199)
_MARGIN_M = 20.0
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
    grids = statistics.tally.bev
    for name, counts in zip(BEV_CLASSES, grids, strict=True) if grids is not None else ():
        max_percent = 100.0 * float(counts.max()) / int(statistics.tally.counts["bev_frames"])
        values = _shrink(counts)
        sheet = Drawing(SMALL[0], SMALL[0] * values.shape[0] / values.shape[1])
        sheet.picture(0, 0, (sheet.width, sheet.height), *heat(values, _darken(class_color(name))))
        sheet.mark_ego(sheet.width / 2, sheet.height / 2)
        yield figure(words(name).capitalize(), sheet.svg(), f"at most in {number(max_percent)} % of frames")


def map_figures(statistics: Statistics) -> Iterator[str]:
    """Figures of each map from above: the paths of the ego, and the positions of other actors."""
    for name, cells in statistics.visited.items():
        scenes = [scene for scene in statistics.scenes if scene.map == name]
        yield figure(name, _map(cells, scenes), legend(SPLIT_COLORS))


def _map(cells: Int64Array, scenes: Sequence[SceneFacts]) -> str:
    """SVG of a map: cells in which other actors were, and the paths of the ego."""
    paths_m = [scene.ego_m for scene in scenes]
    corners_m = np.concatenate([cells * CELL_M, (cells + 1) * CELL_M, *paths_m])
    low_m, high_m = corners_m.min(axis=0) - _MARGIN_M, corners_m.max(axis=0) + _MARGIN_M
    middle_m, extent_m = (low_m + high_m) / 2.0, float((high_m - low_m).max())
    scale = _MAP_SIDE / extent_m
    sheet = Drawing(_MAP_SIDE, _MAP_SIDE)
    visited = _raster((cells + 0.5) * CELL_M - middle_m + extent_m / 2.0, extent_m)
    sheet.picture(0, 0, (_MAP_SIDE, _MAP_SIDE), (visited > 0).astype(np.uint8), ramp(_VISITED)[[0, 200]])
    for scene in scenes:
        points_px = ((scene.ego_m - middle_m) * [1.0, -1.0] + extent_m / 2.0) * scale
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in points_px.tolist())
        color, title = css(SPLIT_COLORS[scene.split]), f"<title>{escape(f'{scene.name}, {scene.split}')}</title>"
        sheet.add(f'<polyline class="path" stroke="{color}" points="{points}">{title}</polyline>')
        x, y = points_px[0].tolist()
        sheet.add(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" fill="{color}">{title}</circle>')
    bar_m = ticks(0.0, extent_m)[1]
    sheet.line(10, _MAP_SIDE - 10, 10 + bar_m * scale, _MAP_SIDE - 10, "axis")
    sheet.text(10, _MAP_SIDE - 15, f"{number(bar_m)} m", anchor="start")
    return sheet.svg()


def _raster(positions_m: AnyArray, extent_m: float) -> AnyArray:
    """(P, P) number of (K, 2) positions in each cell of a square of side ``extent_m``; the last row is at y = 0."""
    pixels = int(min(_MAP_PIXELS, np.ceil(extent_m / CELL_M)))
    column, up = np.clip(positions_m / extent_m * pixels, 0, pixels - 1).astype(int).T
    raster = np.zeros((pixels, pixels))
    np.add.at(raster, (pixels - 1 - up, column), 1.0)
    return raster


def _shrink(values: Int64Array) -> AnyArray:
    """(h, w) values averaged to at most ``_MAX_PIXELS`` rows and columns."""
    rows, columns = values.shape
    share = min(1.0, _MAX_PIXELS / max(rows, columns))
    size = max(1, round(columns * share)), max(1, round(rows * share))
    return np.asarray(cv2.resize(values.astype(np.float32), size, interpolation=cv2.INTER_AREA))


def _darken(color: Color) -> Color:
    """The color, darkened if necessary to stand out from the paper."""
    if sum(color) <= _MAX_COLOR_SUM:
        return color
    red, green, blue = (round(part * _MAX_COLOR_SUM / sum(color)) for part in color)
    return red, green, blue
