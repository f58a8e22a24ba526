"""Collects the points, lines and polygons of a map expansion, to which its other layers refer by tokens.

Coordinates in the map frame enter; records of the layers ``node``, ``line`` and ``polygon`` in nuScenes' global frame
leave. Points that agree to the millimeter are one node, so that neighbors share the nodes of a common border, by which
the devkit finds the next roads.
"""

from collections.abc import Iterable

import numpy as np
import shapely

from simbev_exporters.nuscenes.sites import Site
from simbev_exporters.nuscenes.taxonomy import Record, token
from simbev_ros.foundation.geometry.plan_view import polygon_parts
from simbev_ros.foundation.types import Float64Array

SPECK_M2 = 0.01
"""Smaller areas and holes are left out, as they may be lost by rounding."""

NODE_GRID_M = 0.001
"""Grid of the nodes."""

_DECIMALS = 3


class Canvas:
    """The geometric layers of one site's map expansion."""

    def __init__(self, site: Site) -> None:
        self._site = site
        self._nodes: dict[str, Record] = {}
        self._lines: list[Record] = []
        self._polygons: list[Record] = []

    @property
    def area(self) -> shapely.Polygon:
        """The site's rectangle, map frame."""
        return shapely.box(*self._site.low_m, *self._site.high_m)

    def token(self, layer: str, *parts: object) -> str:
        """Token of a record of a layer, unique in all sites."""
        return token(layer, self._site.token, *parts)

    def to_global(self, points_m: Float64Array) -> Float64Array:
        """(N, 2) points in nuScenes' global frame of (N, 2+) points in the map frame."""
        return points_m[:, :2] - np.array(self._site.low_m)

    def add_line(self, points_m: Float64Array) -> str:
        """Add a line through (N, 2+) points in the map frame; return its token."""
        name = self.token("line", len(self._lines))
        self._lines.append({"token": name, "node_tokens": self.add_nodes(points_m)})
        return name

    def add_polygon(self, polygon: shapely.Polygon) -> str:
        """Add a polygon in the map frame; return its token."""
        name = self.token("polygon", len(self._polygons))
        rings = [self._ring(ring) for ring in polygon.interiors if shapely.Polygon(ring).area >= SPECK_M2]
        holes = [{"node_tokens": ring} for ring in rings if len(ring) > 2]
        self._polygons.append({"token": name, "exterior_node_tokens": self._ring(polygon.exterior), "holes": holes})
        return name

    def add_nodes(self, points_m: Float64Array) -> list[str]:
        """Tokens of the nodes at (N, 2+) points in the map frame, without repetitions in a row."""
        names: list[str] = []
        for x_m, y_m in (np.round(self.to_global(points_m), _DECIMALS) + 0.0).tolist():
            name = self.token("node", x_m, y_m)
            self._nodes.setdefault(name, {"token": name, "x": x_m, "y": y_m})
            if not names or names[-1] != name:
                names.append(name)
        return names

    def layers(self) -> dict[str, list[Record]]:
        """The geometric layers by name."""
        return {"polygon": self._polygons, "line": self._lines, "node": list(self._nodes.values())}

    def _ring(self, ring: shapely.LinearRing) -> list[str]:
        return self.add_nodes(np.asarray(ring.coords)[:-1])


def outline(points_m: Float64Array) -> shapely.Polygon:
    """Polygon with (N, 2+) corners; of one that crosses itself the largest valid part."""
    polygon = shapely.Polygon(points_m[:, :2])
    return polygon if polygon.is_valid else largest(polygon_parts(shapely.make_valid(polygon)))


def largest(polygons: Iterable[shapely.Polygon]) -> shapely.Polygon:
    """The polygon with the largest area; an empty one if there is none."""
    return max(polygons, key=lambda polygon: polygon.area, default=shapely.Polygon())
