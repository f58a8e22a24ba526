"""Makes the stop lines and traffic lights of a map expansion.

The road network and its driving strips enter; records leave. A stop line's area is the painted bar. Its type is that of
what makes traffic halt there: a light, or else the line itself, at which one stops or gives way.
"""

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np
import shapely

from simbev_exporters.nuscenes.map_expansion.canvas import Canvas
from simbev_exporters.nuscenes.taxonomy import Record
from simbev_ros.maps.lane_links import halting_strips, strips_at
from simbev_ros.maps.network import RoadNetwork, Signal
from simbev_ros.maps.roads.lane_strips import LaneStrips
from simbev_ros.maps.roads.layout import StopLine

_BEFORE_END_M = 0.5
_BAR_M = 0.4
_ARROW_M = 1.0
_LAMPS = (("RED", 0.31), ("YELLOW", 0.0), ("GREEN", -0.31))
"""Color and height of each lamp above the center of the head, as our traffic lights are built."""


def signals_by_strip(network: RoadNetwork, driven: LaneStrips) -> dict[str, list[int]]:
    """Rows of the signals that stop the traffic of each strip, by id of the strip."""
    lanes = [network.lanes[signal.lane] for signal in network.signals]
    names = strips_at([(lane, max(lane.length_m - _BEFORE_END_M, 0.0)) for lane in lanes], driven)
    rows: defaultdict[str, list[int]] = defaultdict(list)
    for row, name in enumerate(names):
        if name:
            rows[name].append(row)
    return dict(rows)


def traffic_lights(
    canvas: Canvas, signals: Sequence[Signal], rows_of: Mapping[str, Sequence[int]], block_of: Mapping[str, str]
) -> list[Record]:
    """The layer ``traffic_light``, of the signals of the site's strips; our addition is ``signal_id``, as in topics."""
    block_by_row = {row: block_of.get(strip) for strip, rows in rows_of.items() for row in rows}
    return [_light(canvas, signals[row], row, block_by_row[row]) for row in sorted(block_by_row)]


def stop_lines(
    canvas: Canvas,
    lines: Sequence[StopLine],
    driven: LaneStrips,
    rows_of: Mapping[str, Sequence[int]],
    block_of: Mapping[str, str],
) -> list[Record]:
    """The layer ``stop_line``."""
    records = []
    for number, (line, strips) in enumerate(zip(lines, halting_strips(lines, driven), strict=True)):
        lights = [_light_token(canvas, row) for strip in strips for row in rows_of.get(strip, ())]
        kind = "TRAFFIC_LIGHT" if lights else "YIELD" if line.yields else "STOP_SIGN"
        bar = shapely.LineString(line.ends_m[:, :2]).buffer(_BAR_M / 2.0, cap_style="flat")
        records.append(
            {
                "token": canvas.token("stop_line", number),
                "polygon_token": canvas.add_polygon(bar),
                "stop_line_type": kind,
                "ped_crossing_tokens": [],
                "traffic_light_tokens": lights,
                "road_block_token": next((block_of[strip] for strip in strips if strip in block_of), None),
            }
        )
    return records


def _light(canvas: Canvas, signal: Signal, row: int, block: str | None) -> Record:
    x_m, y_m = canvas.to_global(signal.position_m[None])[0].tolist()
    towards = np.array([math.cos(signal.yaw_rad), math.sin(signal.yaw_rad)])
    arrow_m = np.array([signal.position_m[:2], signal.position_m[:2] + _ARROW_M * towards])
    return {
        "token": _light_token(canvas, row),
        "line_token": canvas.add_line(arrow_m),
        "traffic_light_type": "VERTICAL",
        "from_road_block_token": block,
        "items": [
            {"color": color, "shape": "CIRCLE", "rel_pos": _pose(z_m=height_m), "to_road_block_tokens": []}
            for color, height_m in _LAMPS
        ],
        "pose": _pose(x_m, y_m, float(signal.position_m[2]), signal.yaw_rad),
        "signal_id": row + 1,
    }


def _light_token(canvas: Canvas, row: int) -> str:
    return canvas.token("traffic_light", row)


def _pose(x_m: float = 0.0, y_m: float = 0.0, z_m: float = 0.0, yaw_rad: float = 0.0) -> dict[str, float]:
    return {
        "tx": round(x_m, 3),
        "ty": round(y_m, 3),
        "tz": round(z_m, 3),
        "rx": 0.0,
        "ry": 0.0,
        "rz": round(yaw_rad, 6),
    }
