"""Drawing the hazard areas of a scene."""

import logging
from typing import NamedTuple

import numpy as np
import shapely

from simbev_ros.config.draw import sample
from simbev_ros.config.hazards import Hazards
from simbev_ros.random import stream
from simbev_ros.scene.hazards.area import HazardArea
from simbev_ros.scene.hazards.detours import Detours
from simbev_ros.scene.hazards.guards import barriers, cones, ground_of, road_ends, warning_sign
from simbev_ros.scene.hazards.hazard import HazardKind, HazardSpec
from simbev_ros.scene.hazards.roadside import Roadside
from simbev_ros.scene.hazards.sites import HazardSites
from simbev_ros.scene.hazards.vehicles import accident_vehicles, works_vehicles
from simbev_ros.scene.hazards.workers import workers
from simbev_ros.scene.spec import VehicleSpec
from simbev_ros.scene.streets.lane_positions import Places
from simbev_ros.types import BoolArray, Float64Array

_LOGGER = logging.getLogger(__name__)
_APART_M = 60.0  # between two areas
_FROM_EGO_M = 40.0
_BEFORE_M, _BEHIND_M = 30.0, 16.0  # nobody starts so close to an area on a lane that it closes


class DrawnHazards(NamedTuple):
    """The hazards of a scene, and the vehicles that stand in them."""

    hazards: tuple[HazardSpec, ...]
    vehicles: tuple[VehicleSpec, ...]

    @property
    def closed_edges(self) -> frozenset[str]:
        """Streets that nobody drives onto."""
        return frozenset(edge for hazard in self.hazards for edge in hazard.closed_edges)

    def leave_free(self, places: Places) -> BoolArray:
        """(N,) whether vehicles can start at places: not in or close to an area, nor where it closes the way on."""
        closed = self.closed_edges
        free = ~np.array([lane.edge in closed for lane in places.lanes], bool)[places.row]
        row = {lane.id: row for row, lane in enumerate(places.lanes)}
        for stretch in (stretch for hazard in self.hazards for stretch in hazard.blocked):
            on_lane = places.row == row.get(stretch.lane, -1)
            free[on_lane & (places.s_m >= stretch.to_s_m + _BEHIND_M)] = True
            free &= ~(on_lane & (places.s_m > stretch.from_s_m - _BEFORE_M) & (places.s_m < stretch.to_s_m + _BEHIND_M))
        return free


def draw_hazards(
    config: Hazards,
    seed: int,
    sites: HazardSites,
    places: Places,
    near: BoolArray,
    ego_m: Float64Array,
    detours: Detours | None = None,
) -> DrawnHazards:
    """Hazards at some of the (N,) places for vehicles that are ``near`` the ego, but not close to it, (3,) map frame.

    Roads are closed as far as there are ``detours``; without these, none is. If fewer find room than the configuration
    asks for there is a note.
    """
    order = stream(seed, "hazards.places").permutation(np.flatnonzero(near))
    if config.count == "paper":
        order = order[stream(seed, "hazards.chance").random(len(order)) < config.probability]
        wanted = len(order)
    else:
        wanted = round(sample(config.count, stream(seed, "hazards.count")))
    taken = [shapely.Point(ego_m[:2]).buffer(_FROM_EGO_M - _APART_M / 2.0)]
    drawn: list[tuple[HazardSpec, tuple[VehicleSpec, ...]]] = []
    closed: frozenset[str] = frozenset()
    for place in order.tolist():
        site = sites.at(places.lanes[places.row[place]])
        if len(drawn) == wanted:
            break
        if site is None or site.closed[0].edge in closed:
            continue
        name = f"hazards.{len(drawn)}"
        length_m = min(sample(config.length_m, stream(seed, f"{name}.length")), site.room_m)
        area = site.area(float(places.s_m[place]), length_m)
        ground = shapely.Polygon(area.outline_m)
        if min(ground.distance(other) for other in taken) < _APART_M / 2.0:
            continue
        barred: frozenset[str] = frozenset()
        if site.closes_road:
            cut_off = detours.around(closed | {site.closed[0].edge}) if detours is not None else None
            if cut_off is None:
                continue
            closed, barred = cut_off, cut_off - closed
        taken.append(ground.buffer(_APART_M / 2.0))
        drawn.append(_hazard(config, area, sites.roadside, barred, seed, name))
    if config.count != "paper" and len(drawn) < wanted:
        _LOGGER.warning("room for %d of %d hazards within traffic.spawn_radius_m of the ego", len(drawn), wanted)
    return DrawnHazards(
        tuple(hazard for hazard, _ in drawn), tuple(vehicle for _, vehicles in drawn for vehicle in vehicles)
    )


def _hazard(
    config: Hazards, area: HazardArea, roadside: Roadside, closed_edges: frozenset[str], seed: int, name: str
) -> tuple[HazardSpec, tuple[VehicleSpec, ...]]:
    """One hazard and its vehicles."""
    is_accident = stream(seed, f"{name}.kind").random() < config.accident_share
    kind = HazardKind.ACCIDENT if is_accident else HazardKind.WORK_ZONE
    helped = is_accident and bool(stream(seed, f"{name}.help").random() < config.emergency_vehicle_probability)
    standing_cones, missing = cones(config, kind, area, seed, name)
    guards = [*standing_cones, *([] if is_accident else barriers(area))]
    ends = road_ends(roadside, roadside.entrances(closed_edges))
    sign, sign_distance_m = warning_sign(config, kind, area, roadside, seed, name)
    ground = ground_of(guards)
    vehicles = (
        accident_vehicles(area, ground, helped, seed, name) if is_accident else works_vehicles(area, ground, seed, name)
    )
    people = [] if is_accident else workers(config, area, vehicles, seed, name)
    middle_m, _ = area.places(np.array([area.body_m[0]]), np.array([area.width_m / 2.0]))
    hazard = HazardSpec(
        kind=kind,
        blocked=area.blocked(),
        closed_edges=tuple(sorted(closed_edges)),
        outline_m=tuple(map(tuple, area.outline_m.tolist())),
        z_m=float(middle_m[0, 2]),
        emergency_vehicle=helped if is_accident else None,
        sign_distance_m=sign_distance_m,
        cones_missing=missing,
        props=(*guards, *ends, *([] if sign is None else [sign]), *people),
    )
    return hazard, vehicles
