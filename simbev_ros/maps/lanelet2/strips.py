"""Builds the strips of the layout from lanelets and areas, and the crosswalks."""

from collections.abc import Iterable, Iterator

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.lanelet2.document import Area
from simbev_ros.maps.lanelet2.junctions import Junctions
from simbev_ros.maps.lanelet2.shapes import LaneletShape, pair_borders
from simbev_ros.maps.lanelet2.tags import mirrored, paint_of, speed_limit_mps
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Crosswalk, Line, Strip

_AREA_KINDS = {"parking": LaneKind.PARKING, "freespace": LaneKind.SHOULDER, "traffic_island": LaneKind.MEDIAN}
"""Subtype of an area → its use."""
_MAX_CORNERS = 2_000


def lanelet_strips(junctions: Junctions) -> Iterator[Strip]:
    """Yield one strip for each lanelet."""
    topology = junctions.topology
    for name, shape in topology.shapes.items():
        left, right = topology.left.get(name, ""), topology.right.get(name, "")
        beyond = topology.opposite.get(name, "")
        yield Strip(
            id=name,
            lane=name,
            kind=shape.kind,
            left_m=np.ascontiguousarray(shape.left_m),
            right_m=np.ascontiguousarray(shape.right_m),
            left_line=_line(shape, is_left=True),
            right_line=_line(shape, is_left=False),
            road=name,
            junction=junctions.by_lanelet.get(name, ""),
            speed_mps=speed_limit_mps(shape.lanelet.tags),
            structure=shape.lanelet.tags.get("bridge") == "yes",
            left=left or (beyond if not topology.left_hand else ""),
            right=right or (beyond if topology.left_hand else ""),
            following=topology.following[name],
        )


def area_strips(areas: Iterable[Area]) -> Iterator[Strip]:
    """Yield one strip for each area that is paved or a traffic island."""
    for number, area in enumerate(areas):
        kind = _AREA_KINDS.get(area.tags.get("subtype", "")) or _AREA_KINDS.get(area.tags.get("type", ""))
        if kind is not None and len(area.outline_m) <= _MAX_CORNERS:
            left_m, right_m = pair_borders(*_sides_m(area.outline_m))
            name = f"area{number}"
            yield Strip(id=name, lane=name, kind=kind, left_m=left_m, right_m=right_m, road=name)


def crosswalks_of(shapes: Iterable[LaneletShape]) -> tuple[Crosswalk, ...]:
    """The crosswalks of a map."""
    found = []
    for shape in shapes:
        if shape.kind is LaneKind.CROSSING:
            along_m = (shape.left_m[-1] + shape.right_m[-1] - shape.left_m[0] - shape.right_m[0])[:2]
            length_m = np.linalg.norm(along_m)
            if length_m > 0.0:
                outline_m = np.concatenate([shape.left_m, shape.right_m[::-1]])
                found.append(Crosswalk(outline_m, along_m / length_m))
    return tuple(found)


def _line(shape: LaneletShape, is_left: bool) -> Line:
    """Paint on one border of a lanelet, seen from its inside outward."""
    bound, flipped = (shape.lanelet.left, shape.flipped[0]) if is_left else (shape.lanelet.right, shape.flipped[1])
    line = paint_of(bound, flipped)
    return Line(mirrored(line.paint), line.color, line.width_m) if is_left else line


def _sides_m(outline_m: Float64Array) -> tuple[Float64Array, Float64Array]:
    """The two chains of (N, 3) corners between the two that are farthest apart, from one end to the other."""
    gaps_m = np.linalg.norm(outline_m[:, None, :2] - outline_m[None, :, :2], axis=2)
    first, last = sorted(np.unravel_index(int(np.argmax(gaps_m)), gaps_m.shape))
    return outline_m[first : last + 1], np.concatenate([outline_m[last:], outline_m[: first + 1]])[::-1]
