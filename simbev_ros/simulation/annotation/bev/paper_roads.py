"""Roads as the paper defines them: all cells nearer to a lane's center line than the lane's width, then closed.

The paper measures from waypoints that are 0.4 m apart, which shortens its distances by at most 6 mm. It also takes the
roads that a camera sees from above, which here are the exact ones.
"""

from collections.abc import Sequence

import numpy as np
import shapely
from scipy.ndimage import binary_closing
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.mesh.primitives import triangulate
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import indexed_polygon_parts
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import UInt16Array
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.simulation.annotation.bev.footprint import Footprint, merge_footprints
from simbev_ros.simulation.annotation.bev.hazards import LabeledArea

_ROAD = BEV_CLASSES.index("road")


def lane_areas(layout: Layout) -> tuple[LabeledArea, ...]:
    """The surroundings of all driving lanes, for each level."""
    strips = {level: layout.strips_of(LaneKind.DRIVING, level=level) for level in layout.levels}
    return tuple(LabeledArea(_footprint(each), level) for level, each in strips.items() if each)


def close_roads(labels: UInt16Array) -> UInt16Array:
    """(rows, columns) labels after a binary closing of the roads, with cells that share a side as neighbors."""
    road = np.pad(labels >> _ROAD & 1 == 1, 2, "edge")  # roads do not end at the border of the grid
    return labels | (binary_closing(road)[2:-2, 2:-2].astype(np.uint16) << np.uint16(_ROAD))


def _footprint(strips: Sequence[Strip]) -> Footprint:
    lanes = overlay.union_all([_around(strip) for strip in strips])
    parts, _ = indexed_polygon_parts(np.array([lanes], object))
    meshes = [triangulate(part) for part in parts]
    return merge_footprints([Footprint(*mesh, np.full(len(mesh[1]), _ROAD, np.uint8)) for mesh in meshes])


def _around(strip: Strip) -> BaseGeometry:
    """All points nearer to a strip's center line than its width, which may change along it."""
    center_m, width_m = strip.center_m[:, :2], np.linalg.norm((strip.left_m - strip.right_m)[:, :2], axis=1)
    discs = shapely.buffer(shapely.points(center_m), width_m)
    pairs = shapely.multipolygons(np.stack([discs[:-1], discs[1:]], axis=1))
    return overlay.union_all(shapely.convex_hull(pairs))
