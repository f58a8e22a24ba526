"""Plans of maps, on which pages show paths: a square of the road network as a picture, and its place in a chart.

A road network and positions on it enter; JPEG pictures and Plotly layouts leave.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.show.maps.map_plan import MapPlan
from simbev_ros.show.pages.charts import axis_title
from simbev_ros.show.reports.svg_drawing import jpeg_bytes

_PIXELS = 900
_OPACITY = 0.9


@dataclass(frozen=True, eq=False, slots=True)
class Square:
    """A square of a map.

    Attributes:
        center_m: (2,) center, map frame.
        side_m: Length of a side.
    """

    center_m: Float64Array
    side_m: float

    @classmethod
    def around(cls, positions_m: Float64Array, margin_m: float, min_side_m: float) -> "Square":
        """The square around (N, 2) positions, N > 0, on whole meters, with a margin."""
        low_m, high_m = positions_m.min(axis=0), positions_m.max(axis=0)
        side_m = max(float((high_m - low_m).max()) + 2.0 * margin_m, min_side_m)
        return cls(np.round((low_m + high_m) / 2.0), float(np.ceil(side_m)))

    def layout(self, height_px: int, picture: str = "") -> dict[str, Any]:
        """Plotly's layout of a chart of this square, north up, over a picture at an address; empty: over nothing."""
        (x, y), half = self.center_m.tolist(), self.side_m / 2.0
        bare = {"showgrid": False, "zeroline": False, "constrain": "domain"}
        layout: dict[str, Any] = {
            "height": height_px,
            "xaxis": {"range": [x - half, x + half], "title": axis_title("x, m"), **bare},
            "yaxis": {"range": [y - half, y + half], "title": axis_title("y, m"), "scaleanchor": "x", **bare},
        }
        if picture:
            place = {"xref": "x", "yref": "y", "x": x - half, "y": y + half, "sizex": self.side_m, "sizey": self.side_m}
            layout["images"] = [
                {"source": picture, "layer": "below", "sizing": "stretch", "opacity": _OPACITY, **place}
            ]
        return layout


def plan_picture(network: RoadNetwork, square: Square, size_px: int = _PIXELS) -> bytes:
    """The plan of a square of a map as JPEG, north up."""
    return jpeg_bytes(MapPlan(network, square.center_m, square.side_m, size_px).picture())
