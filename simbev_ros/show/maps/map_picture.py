"""Draws a map from above: a plan of the whole map next to an orthophoto of a part of it.

A road network and its static scene enter; one RGB picture leaves.
"""

from pathlib import Path

import cv2
import numpy as np

from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.drawing.canvas import Color, draw_text
from simbev_ros.foundation.files.whole_files import write_errors, write_whole
from simbev_ros.foundation.types import Float64Array, UInt8Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.show.maps.map_plan import MapPlan
from simbev_ros.show.maps.orthophoto import orthophoto

WHOLE_M, DETAIL_M = 720.0, 560.0
"""Maximum side of a map with an orthophoto of all of it, and the side of the shown square of a larger map."""
_SIDE_PX, _GAP_PX = 900, 12
_MARGIN = 1.06
_MIN_SIDE_M = 120.0  # a single short road is shown with what stands around it
_BAR_PX = 0.22
_DARK: Color = (40, 40, 44)
_LIGHT: Color = (250, 250, 250)


def overview_picture(network: RoadNetwork, static: StaticScene, position_m: Float64Array) -> UInt8Array:
    """Draw the plan of a map and, to its right, an orthophoto of the surroundings of a position.

    Args:
        network: The map.
        static: Its static scene.
        position_m: (2,) position that the orthophoto should show, map frame; a small map is shown as a whole.

    Returns:
        (900, 1812, 3) uint8 RGB.
    """
    center_m, whole_m = bounding_square(network)
    plan = MapPlan(network, center_m, whole_m, _SIDE_PX)
    detail_m = whole_m if whole_m <= WHOLE_M else DETAIL_M
    margin_m = (whole_m - detail_m) / 2.0
    position_m = np.clip(position_m, center_m - margin_m, center_m + margin_m)
    if margin_m > 0.0:
        plan.draw_frame(position_m, detail_m)
    left, right = plan.picture(), orthophoto(static.tiles, position_m, detail_m, _SIDE_PX)
    _draw_scale_bar(left, whole_m, _DARK, _LIGHT)
    _draw_scale_bar(right, detail_m, _LIGHT, _DARK)
    return np.concatenate([left, np.full((_SIDE_PX, _GAP_PX, 3), 255, np.uint8), right], axis=1)


def bounding_square(network: RoadNetwork) -> tuple[Float64Array, float]:
    """(2,) center, map frame, and side of the square that contains all lanes, with a margin; meters."""
    points_m = np.concatenate([lane.centerline_m[:, :2] for lane in network.lanes.values()])
    low_m, high_m = points_m.min(axis=0), points_m.max(axis=0)
    return (low_m + high_m) / 2.0, max(float((high_m - low_m).max()) * _MARGIN, _MIN_SIDE_M)


def write_picture(path: Path, picture: UInt8Array) -> None:
    """Write (H, W, 3) RGB as a PNG file, and make its folder if necessary.

    Raises:
        InputError: The file cannot be written.
    """
    with write_errors(path):
        write_whole(path, cv2.imencode(".png", picture[..., ::-1])[1].tobytes())


def _draw_scale_bar(picture: UInt8Array, side_m: float, color: Color, background: Color) -> None:
    """Draw a scale bar of a round length in the lower left corner, in place."""
    wanted_m = _BAR_PX * side_m
    power = 10.0 ** np.floor(np.log10(wanted_m))
    length_m = next(step * power for step in (5.0, 2.0, 1.0) if step * power <= wanted_m)
    length_px, base = round(length_m / side_m * _SIDE_PX), _SIDE_PX - 26
    plate = picture[base - 32 : base + 14, 14 : length_px + 34]
    plate[:] = (plate + np.array(background)) // 2
    cv2.rectangle(picture, (24, base), (24 + length_px, base + 4), color, cv2.FILLED)
    text = f"{length_m:.0f} m" if length_m < 1000 else f"{length_m / 1000:.0f} km"
    draw_text(picture, text, 24, base - 8, size=17, color=color)
