"""Lanes of a map and their boundaries as OSI has them, from the map file in a scene's bag; this needs the simulator.

Lanes in driving direction have a center line and a boundary on each side. A junction is one lane of the type
intersection, with a pairing for each path through it.
"""

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from osi3.osi_common_pb2 import Vector3d
from osi3.osi_lane_pb2 import Lane, LaneBoundary

from simbev_exporters.osi.objects import osi_names
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.lane_links import StripLinks, strip_links
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Line, Strip

LANE_IDS = 1 << 24
"""Offset of the ids of lanes: three for each strip, its own and those of its boundaries; then intersections."""

_Pair = tuple[int, int]


@dataclass(frozen=True, slots=True)
class MapMessages:
    """The static part of a scene's ground truth.

    Attributes:
        lanes: Lanes and intersections.
        boundaries: Boundaries of the lanes.
        proj_string: Projection of the map frame, for PROJ.
    """

    lanes: tuple[Lane, ...]
    boundaries: tuple[LaneBoundary, ...]
    proj_string: str


def map_messages(network: RoadNetwork) -> MapMessages:
    """Lanes and boundaries of a map."""
    strips = network.layout.strips_of(*map(LaneKind, osi_names()["lanes"]))
    links = strip_links(strips)
    ids = {strip.id: LANE_IDS + 3 * row for row, strip in enumerate(strips)}
    places = {strip.junction: 0 for strip in strips if strip.junction}
    crossing = {name: LANE_IDS + 3 * len(strips) + row for row, name in enumerate(places)}
    of_strip = {strip.id: crossing.get(strip.junction, ids[strip.id]) for strip in strips}
    plain = [(strip, found) for strip, found in zip(strips, links, strict=True) if not strip.junction]
    lanes = [_lane(strip, found, ids[strip.id], of_strip) for strip, found in plain]
    boundaries = [
        _boundary(ids[strip.id] + side, border_m, line)
        for strip, _ in plain
        for side, (border_m, line) in enumerate(
            ((strip.left_m, strip.left_line), (strip.right_m, strip.right_line)), start=1
        )
    ]
    intersections = _intersections(strips, links, crossing, of_strip)
    return MapMessages((*lanes, *intersections), tuple(boundaries), network.datum.proj_string)


def _lane(strip: Strip, links: StripLinks, number: int, of_strip: Mapping[str, int]) -> Lane:
    kinds, (lane_type, subtype) = Lane.Classification, osi_names()["lanes"][strip.kind]
    lane = Lane()
    lane.id.value = number
    about = lane.classification
    about.type, about.subtype = getattr(kinds, f"TYPE_{lane_type}"), getattr(kinds, f"SUBTYPE_{subtype}")
    about.centerline.extend(_points(strip.center_m))
    about.centerline_is_driving_direction = True
    about.left_lane_boundary_id.add().value = number + 1
    about.right_lane_boundary_id.add().value = number + 2
    for field, others in ((about.left_adjacent_lane_id, links.left), (about.right_adjacent_lane_id, links.right)):
        for other in others:
            field.add().value = of_strip[other]
    _add_pairings(lane, _pairs(links, of_strip, number))
    return lane


def _intersections(
    strips: Sequence[Strip], links: Sequence[StripLinks], crossing: Mapping[str, int], of_strip: Mapping[str, int]
) -> Iterator[Lane]:
    pairs: defaultdict[str, set[_Pair]] = defaultdict(set)
    for strip, found in zip(strips, links, strict=True):
        if strip.junction and strip.kind is LaneKind.DRIVING:
            pairs[strip.junction] |= _pairs(found, of_strip, crossing[strip.junction])
    for name, number in crossing.items():
        lane = Lane()
        lane.id.value = number
        lane.classification.type = Lane.Classification.TYPE_INTERSECTION
        _add_pairings(lane, pairs[name])
        yield lane


def _pairs(links: StripLinks, of_strip: Mapping[str, int], own: int) -> set[_Pair]:
    """Lanes before and after a strip of a lane, paired each with each; 0: there is none."""
    before, after = ({of_strip[each] for each in group} - {own} for group in (links.predecessors, links.successors))
    return set(product(before or {0}, after or {0})) - {(0, 0)}


def _add_pairings(lane: Lane, pairs: Collection[_Pair]) -> None:
    for before, after in sorted(pairs):
        pairing = lane.classification.lane_pairing.add()
        if before:
            pairing.antecessor_lane_id.value = before
        if after:
            pairing.successor_lane_id.value = after


def _boundary(number: int, border_m: Float64Array, line: Line) -> LaneBoundary:
    kinds, paint = LaneBoundary.Classification, osi_names()["lines"][line.paint]
    boundary = LaneBoundary()
    boundary.id.value = number
    boundary.classification.type = getattr(kinds, f"TYPE_{paint}")
    is_painted = paint not in ("NO_LINE", "CURB")
    boundary.classification.color = getattr(kinds, f"COLOR_{line.color.upper() if is_painted else 'NONE'}")
    for point in _points(border_m):
        boundary.boundary_line.add(position=point, width=line.width_m if is_painted else 0.0)
    return boundary


def _points(points_m: Float64Array) -> list[Vector3d]:
    return [Vector3d(x=x_m, y=y_m, z=z_m) for x_m, y_m, z_m in points_m.tolist()]
