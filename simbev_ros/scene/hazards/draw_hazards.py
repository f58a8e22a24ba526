"""Draw the hazard areas of a scene: sites, free positions and detours in, hazard specifications and vehicles out."""

import logging
from typing import NamedTuple

import numpy as np
import shapely

from simbev_ros.config.draw import sample
from simbev_ros.config.hazards import Hazards
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.scene.hazards.area import HazardArea
from simbev_ros.scene.hazards.detours import Detours
from simbev_ros.scene.hazards.guards import (
    place_barriers,
    place_cones,
    place_road_closures,
    place_warning_sign,
    props_footprint,
)
from simbev_ros.scene.hazards.roadside import Roadside
from simbev_ros.scene.hazards.sites import HazardSites
from simbev_ros.scene.hazards.vehicles import place_accident_vehicles, place_work_vehicles
from simbev_ros.scene.hazards.workers import place_workers
from simbev_ros.scene.streets.lane_positions import LanePositions
from simbev_ros.schema.scene.hazard import HazardKind, HazardSpec
from simbev_ros.schema.scene.spec import VehicleSpec

_LOGGER = logging.getLogger(__name__)
_MIN_GAP_M = 60.0  # minimum gap between two areas
_MIN_AGENT_DISTANCE_M = 40.0
_KEEP_CLEAR_BEFORE_M, _KEEP_CLEAR_BEHIND_M = (
    30.0,
    16.0,
)  # no vehicle starts this close to an area on a lane that it closes


class DrawnHazards(NamedTuple):
    """The hazards of a scene and the vehicles that stand in them."""

    hazards: tuple[HazardSpec, ...]
    vehicles: tuple[VehicleSpec, ...]

    @property
    def closed_edges(self) -> frozenset[str]:
        """Edges that are closed to all traffic."""
        return frozenset(edge for hazard in self.hazards for edge in hazard.closed_edges)

    def free_positions(self, positions: LanePositions) -> BoolArray:
        """(N,) whether vehicles can start at positions: not in or close to an area, and not on a closed edge."""
        closed = self.closed_edges
        free = ~np.array([lane.edge in closed for lane in positions.lanes], bool)[positions.row]
        row = {lane.id: row for row, lane in enumerate(positions.lanes)}
        for stretch in (stretch for hazard in self.hazards for stretch in hazard.blocked):
            on_lane = positions.row == row.get(stretch.lane, -1)
            free[on_lane & (positions.s_m >= stretch.to_s_m + _KEEP_CLEAR_BEHIND_M)] = True
            free &= ~(
                on_lane
                & (positions.s_m > stretch.from_s_m - _KEEP_CLEAR_BEFORE_M)
                & (positions.s_m < stretch.to_s_m + _KEEP_CLEAR_BEHIND_M)
            )
        return free


def draw_hazards(
    config: Hazards,
    seed: int,
    sites: HazardSites,
    positions: LanePositions,
    near: BoolArray,
    agents_m: Float64Array,
    detours: Detours | None = None,
) -> DrawnHazards:
    """Draw hazards at some of the (N,) positions that are ``near`` the agents, but not close to any of them.

    The agents start at (A, 3) ``agents_m``, map frame.

    Whole roads are closed only where ``detours`` permit it, never without it. Logs a warning if fewer hazards fit than
    the configuration asks for.
    """
    order = stream(seed, "hazards.places").permutation(np.flatnonzero(near))
    if config.count == "paper":
        order = order[stream(seed, "hazards.chance").random(len(order)) < config.probability]
        requested = len(order)
    else:
        requested = round(sample(config.count, stream(seed, "hazards.count")))
    occupied = [shapely.Point(agent_m[:2]).buffer(_MIN_AGENT_DISTANCE_M - _MIN_GAP_M / 2.0) for agent_m in agents_m]
    drawn: list[tuple[HazardSpec, tuple[VehicleSpec, ...]]] = []
    closed: frozenset[str] = frozenset()
    for position_index in order.tolist():
        site = sites.site_at(positions.lanes[positions.row[position_index]])
        if len(drawn) == requested:
            break
        if site is None or site.closed[0].edge in closed:
            continue
        name = f"hazards.{len(drawn)}"
        length_m = min(sample(config.length_m, stream(seed, f"{name}.length")), site.room_m)
        area = site.area_around(float(positions.s_m[position_index]), length_m)
        ground = shapely.Polygon(area.outline_m)
        if min(ground.distance(other) for other in occupied) < _MIN_GAP_M / 2.0:
            continue
        closed_edges: frozenset[str] = frozenset()
        if site.closes_road:
            cut_off = detours.closure_for(closed | {site.closed[0].edge}) if detours is not None else None
            if cut_off is None:
                continue
            closed, closed_edges = cut_off, cut_off - closed
        occupied.append(ground.buffer(_MIN_GAP_M / 2.0))
        drawn.append(_draw_hazard(config, area, sites.roadside, closed_edges, seed, name))
    if config.count != "paper" and len(drawn) < requested:
        _LOGGER.warning("room for %d of %d hazards within traffic.spawn_radius_m of the ego", len(drawn), requested)
    return DrawnHazards(
        tuple(hazard for hazard, _ in drawn), tuple(vehicle for _, vehicles in drawn for vehicle in vehicles)
    )


def _draw_hazard(
    config: Hazards, area: HazardArea, roadside: Roadside, closed_edges: frozenset[str], seed: int, name: str
) -> tuple[HazardSpec, tuple[VehicleSpec, ...]]:
    """Draw one hazard and its vehicles."""
    is_accident = stream(seed, f"{name}.kind").random() < config.accident_share
    kind = HazardKind.ACCIDENT if is_accident else HazardKind.WORK_ZONE
    has_help = is_accident and bool(stream(seed, f"{name}.help").random() < config.emergency_vehicle_probability)
    standing_cones, missing = place_cones(config, kind, area, seed, name)
    guards = [*standing_cones, *([] if is_accident else place_barriers(area))]
    ends = place_road_closures(roadside, roadside.entrances(closed_edges))
    sign, sign_distance_m = place_warning_sign(config, kind, area, roadside, seed, name)
    ground = props_footprint(guards)
    vehicles = (
        place_accident_vehicles(area, ground, has_help, seed, name)
        if is_accident
        else place_work_vehicles(area, ground, seed, name)
    )
    workers = [] if is_accident else place_workers(config, area, vehicles, seed, name)
    center_m, _ = area.positions(np.array([area.body_m[0]]), np.array([area.width_m / 2.0]))
    hazard = HazardSpec(
        kind=kind,
        blocked=area.blocked_stretches(),
        closed_edges=tuple(sorted(closed_edges)),
        outline_m=tuple(map(tuple, area.outline_m.tolist())),
        z_m=float(center_m[0, 2]),
        emergency_vehicle=has_help if is_accident else None,
        sign_distance_m=sign_distance_m,
        cones_missing=missing,
        props=(*guards, *ends, *([] if sign is None else [sign]), *workers),
    )
    return hazard, vehicles
