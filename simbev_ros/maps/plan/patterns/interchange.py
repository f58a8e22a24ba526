"""Adds interchanges to a draft: ramps between a motorway's carriageways and a crossing road at another height."""

import numpy as np
import shapely

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.plan.curves import bezier_between
from simbev_ros.maps.plan.draft import Draft, DraftRoad, RoadClass
from simbev_ros.maps.plan.lines import length_m, stations_m
from simbev_ros.maps.plan.patterns.carriageway import Carriageway, Interval

ACCELERATION_M = 200.0
"""Length of the acceleration lane of an entry."""

DECELERATION_M = 160.0
"""Length of the deceleration lane of an exit."""

_RAMP_LENGTH_M = 250.0  # length of a ramp along the motorway
_TERMINAL_ANGLE_RAD = np.radians(28.0)  # angle between a ramp's end and the motorway
_RAMP_SPEED_KMH = 60.0
_PAVING_GAP_M = 0.3  # between the paving of a ramp and the start of the shoulder


def add_exit_ramp(
    draft: Draft, carriageway: Carriageway, station_m: float, name: str, end_m: Float64Array, heading: Float64Array
) -> None:
    """Append a ramp that leaves a carriageway at ``station_m`` and ends at (2,) ``end_m`` with a (2,) direction."""
    line_m, node_m = _ramp_line(carriageway, station_m, end_m, heading, leaves=True)
    draft.roads.append(DraftRoad(name, _ramp_kind(carriageway), line_m, joins_m=(node_m, None)))
    carriageway.added.append(Interval(station_m - DECELERATION_M, station_m))
    carriageway.gores.append(Interval(station_m, station_m + _gore_m(carriageway, station_m, line_m)))


def add_entry_ramp(
    draft: Draft, carriageway: Carriageway, station_m: float, name: str, start_m: Float64Array, heading: Float64Array
) -> None:
    """Append a ramp that starts at (2,) ``start_m`` with a (2,) direction and joins a carriageway at ``station_m``."""
    line_m, node_m = _ramp_line(carriageway, station_m, start_m, heading, leaves=False)
    draft.roads.append(DraftRoad(name, _ramp_kind(carriageway), line_m, joins_m=(None, node_m)))
    carriageway.added.append(Interval(station_m, station_m + ACCELERATION_M))
    carriageway.gores.append(Interval(station_m - _gore_m(carriageway, station_m, line_m[::-1]), station_m))


def add_half_diamond(
    draft: Draft, carriageway: Carriageway, crossing_m: float, name: str, terminal_m: Float64Array
) -> None:
    """Append an exit before and an entry after a crossing, both at a terminal to the right of the carriageway."""
    _, along = carriageway.pose(crossing_m)
    right = np.array([along[1], -along[0]])
    toward = np.cos(_TERMINAL_ANGLE_RAD) * along + np.sin(_TERMINAL_ANGLE_RAD) * right
    away = np.cos(_TERMINAL_ANGLE_RAD) * along - np.sin(_TERMINAL_ANGLE_RAD) * right
    add_exit_ramp(draft, carriageway, crossing_m - _RAMP_LENGTH_M, f"{name}.exit", terminal_m, toward)
    add_entry_ramp(draft, carriageway, crossing_m + _RAMP_LENGTH_M, f"{name}.entry", terminal_m, away)


def _ramp_kind(carriageway: Carriageway) -> RoadClass:
    return RoadClass(
        one_way=True,
        line_at="left",
        lane_width_m=carriageway.kind.lane_width_m,
        speed_kmh=min(_RAMP_SPEED_KMH, carriageway.kind.speed_kmh),
        shoulder_m=1.5,
        priority=1,
    )


def _ramp_line(
    carriageway: Carriageway, station_m: float, other_m: Float64Array, heading: Float64Array, leaves: bool
) -> tuple[Float64Array, Float64Array]:
    """The ramp's line, tangent to the right edge of the carriageway's lanes, and the vertex at which both meet."""
    node_m, along = carriageway.pose(station_m)
    start_or_end_m = node_m + carriageway.lanes_at(station_m) * carriageway.kind.lane_width_m * np.array(
        [along[1], -along[0]]
    )
    if leaves:
        return bezier_between(start_or_end_m, along, other_m, heading, (0.45, 0.35)), node_m
    return bezier_between(other_m, heading, start_or_end_m, along, (0.35, 0.45)), node_m


def _gore_m(carriageway: Carriageway, station_m: float, line_m: Float64Array) -> float:
    """Length along a ramp, measured from the carriageway, on which there is no room for a shoulder between both."""
    lanes_m = carriageway.lanes_at(station_m) * carriageway.kind.lane_width_m
    gap_m = shapely.distance(shapely.LineString(carriageway.line_m), shapely.points(line_m)) - lanes_m
    wide_enough = np.flatnonzero(gap_m > carriageway.kind.shoulder_m + _PAVING_GAP_M)
    return float(stations_m(line_m)[wide_enough[0]]) if len(wide_enough) else length_m(line_m)


def crossing_stations_m(line_m: Float64Array, other_m: Float64Array) -> tuple[float, float] | None:
    """Stations on two lines of their first intersection along the first line; None if they do not cross."""
    line, other = shapely.LineString(line_m), shapely.LineString(other_m)
    points = [shapely.Point(point) for point in shapely.get_coordinates(overlay.intersection(line, other))]
    if not points:
        return None
    first = min(points, key=line.project)
    return float(line.project(first)), float(other.project(first))
