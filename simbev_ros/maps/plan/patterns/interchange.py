"""Interchanges: ramps between a motorway's carriageways and a road that crosses it at another height."""

import numpy as np
import shapely

from simbev_ros.maps.plan.curves import joining
from simbev_ros.maps.plan.draft import Draft, DraftRoad, RoadClass
from simbev_ros.maps.plan.lines import length_m, stations_m
from simbev_ros.maps.plan.patterns.carriageway import Carriageway, Interval
from simbev_ros.types import Float64Array

ACCELERATION_M = 200.0
"""Length of the lane that entering traffic gets."""

DECELERATION_M = 160.0
"""Length of the lane that leaving traffic gets."""

_RUN_M = 250.0  # of a ramp along the motorway
_TURN_RAD = np.radians(28.0)  # between a ramp's end and the motorway
_RAMP_SPEED_KMH = 60.0
_GAP_M = 0.3  # between the paving of a ramp and a shoulder that begins again


def exit_ramp(
    draft: Draft, way: Carriageway, at_m: float, name: str, end_m: Float64Array, heading: Float64Array
) -> None:
    """Append a ramp that leaves a carriageway ``at_m`` and ends at a place with a (2,) direction."""
    line_m, node_m = _ramp_line(way, at_m, end_m, heading, leaves=True)
    draft.roads.append(DraftRoad(name, _ramp_kind(way), line_m, joins_m=(node_m, None)))
    way.added.append(Interval(at_m - DECELERATION_M, at_m))
    way.gores.append(Interval(at_m, at_m + _gore_m(way, at_m, line_m)))


def entry_ramp(
    draft: Draft, way: Carriageway, at_m: float, name: str, start_m: Float64Array, heading: Float64Array
) -> None:
    """Append a ramp that starts at a place with a (2,) direction and joins a carriageway ``at_m``."""
    line_m, node_m = _ramp_line(way, at_m, start_m, heading, leaves=False)
    draft.roads.append(DraftRoad(name, _ramp_kind(way), line_m, joins_m=(None, node_m)))
    way.added.append(Interval(at_m, at_m + ACCELERATION_M))
    way.gores.append(Interval(at_m - _gore_m(way, at_m, line_m[::-1]), at_m))


def half_diamond(draft: Draft, way: Carriageway, crossing_m: float, name: str, terminal_m: Float64Array) -> None:
    """Append an exit before and an entry after a crossing, both at a terminal to the right of the carriageway."""
    _, along = way.pose(crossing_m)
    right = np.array([along[1], -along[0]])
    toward = np.cos(_TURN_RAD) * along + np.sin(_TURN_RAD) * right
    away = np.cos(_TURN_RAD) * along - np.sin(_TURN_RAD) * right
    exit_ramp(draft, way, crossing_m - _RUN_M, f"{name}.exit", terminal_m, toward)
    entry_ramp(draft, way, crossing_m + _RUN_M, f"{name}.entry", terminal_m, away)


def _ramp_kind(way: Carriageway) -> RoadClass:
    return RoadClass(
        one_way=True,
        line_at="left",
        lane_width_m=way.kind.lane_width_m,
        speed_kmh=min(_RAMP_SPEED_KMH, way.kind.speed_kmh),
        shoulder_m=1.5,
        priority=1,
    )


def _ramp_line(
    way: Carriageway, at_m: float, other_m: Float64Array, heading: Float64Array, leaves: bool
) -> tuple[Float64Array, Float64Array]:
    """The ramp's line, tangent to the carriageway's lanes and on their right, and the vertex where both meet."""
    node_m, along = way.pose(at_m)
    beside_m = node_m + way.lanes_at(at_m) * way.kind.lane_width_m * np.array([along[1], -along[0]])
    if leaves:
        return joining(beside_m, along, other_m, heading, (0.45, 0.35)), node_m
    return joining(other_m, heading, beside_m, along, (0.35, 0.45)), node_m


def _gore_m(way: Carriageway, at_m: float, line_m: Float64Array) -> float:
    """How far along it a ramp (seen from the carriageway) is too near for a shoulder between both."""
    lanes_m = way.lanes_at(at_m) * way.kind.lane_width_m
    gap_m = shapely.distance(shapely.LineString(way.line_m), shapely.points(line_m)) - lanes_m
    far = np.flatnonzero(gap_m > way.kind.shoulder_m + _GAP_M)
    return float(stations_m(line_m)[far[0]]) if len(far) else length_m(line_m)


def crossing_stations_m(line_m: Float64Array, other_m: Float64Array) -> tuple[float, float] | None:
    """Distances from the starts of two lines to where they first cross, along the first; None where they do not."""
    line, other = shapely.LineString(line_m), shapely.LineString(other_m)
    places = [shapely.Point(place) for place in shapely.get_coordinates(shapely.intersection(line, other))]
    if not places:
        return None
    first = min(places, key=line.project)
    return float(line.project(first)), float(other.project(first))
