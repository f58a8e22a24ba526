"""Draw the events along a route: what happens when the first agent comes by, and the actors that only events have."""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from simbev_ros.config.draw import sample
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.random import stream
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.drawing.start_clearance import StartClearance
from simbev_ros.scene.events import junction_places, lane_places
from simbev_ros.scene.events.kinds import EventClass, event_classes
from simbev_ros.scene.events.route_line import Place, RouteLine
from simbev_ros.schema.scene.drive_spec import EventKind, EventSpec, RouteSpec
from simbev_ros.schema.scene.hazard import HazardSpec
from simbev_ros.schema.scene.spec import PedestrianSpec, SceneSpec, StandSpec, VehicleSpec, WaypointSpec

_LOGGER = logging.getLogger(__name__)
_PLACES: Mapping[str, Callable[[RouteLine], Iterator[Place]]] = {
    **{each.__name__: each for each in (lane_places.ahead, lane_places.anywhere, lane_places.behind)},
    **{each.__name__: each for each in (lane_places.bend, lane_places.beside, lane_places.curb, lane_places.lane)},
    **{each.__name__: each for each in (junction_places.left_turn, junction_places.merge, junction_places.red_light)},
    **{each.__name__: each for each in (junction_places.right_turn, junction_places.roundabout)},
}
_LEADING = ("ahead", "bend")  # places of vehicles that lead from the start: one serves all such events
_MIN_GAP_M = 2.0


class DrawnEvents(NamedTuple):
    """Events in the order of the route, and the actors that are added to the scene for them.

    The vehicles that stand for the whole scene come after those in traffic.
    """

    events: tuple[EventSpec, ...] = ()
    vehicles: tuple[VehicleSpec, ...] = ()
    pedestrians: tuple[PedestrianSpec, ...] = ()


class _Drawn(NamedTuple):
    """One event and its actors."""

    kind: EventKind
    place: Place
    parameters: dict[str, float]
    vehicle: VehicleSpec | None
    pedestrian: PedestrianSpec | None


def draw_events(
    scenario: Scenario,
    seed: int,
    network: RoadNetwork,
    route: RouteSpec,
    vehicles: tuple[VehicleSpec, ...],
    pedestrians: tuple[PedestrianSpec, ...],
    clearance: StartClearance,
    hazards: Sequence[HazardSpec] = (),
) -> DrawnEvents:
    """Draw the events of a scene's route, each with streams of its own.

    Kinds that are asked for and have no place on the route are logged.

    Args:
        scenario: The configuration.
        seed: Seed of the scene.
        network: Roads of the scene's map.
        route: The route of the first agent.
        vehicles: Vehicles drawn so far, the first agent's first; the vehicles of events follow them in the scene.
        pedestrians: Pedestrians drawn so far; those of events follow them.
        clearance: The ground that vehicles occupy, to which those of events are added.
        hazards: Hazard areas, whose lanes have no events.
    """
    wanted, count = None if scenario.drive is None else scenario.drive.events, _count(scenario, seed)
    if wanted is None or not count:
        return DrawnEvents()
    line, names = RouteLine(route, network), [name for name, weight in wanted.kinds.items() if weight]
    closed = {stretch.lane for hazard in hazards for stretch in hazard.blocked}
    found_by_kind = {kind: _PLACES[event_classes()[kind].places](line) for kind in map(EventKind, names)}
    places = {
        kind: [each for each in found if not closed & {line.lane_at(each.at_m).id, each.start and each.start.lane}]
        for kind, found in found_by_kind.items()
    }
    missing = [kind for kind, found in places.items() if not found]
    if missing and "kinds" in wanted.model_fields_set and not wanted.required:
        _LOGGER.warning("%s: the route has no place for the events %s", network.name, ", ".join(missing))
    drawn: list[_Drawn] = []
    gap_m = max(_MIN_GAP_M, *(vehicle.min_gap_m for vehicle in vehicles))
    for number in range(count):
        rng = stream(seed, f"drive_events.{number}")
        free = {kind: _free(found, drawn, wanted.spacing_m) for kind, found in places.items()}
        weights = {kind: wanted.kinds[kind.value] for kind, found in free.items() if found}
        event = _draw_event(free, weights, drawn, clearance, gap_m, rng)
        if event is None and wanted.required:
            break
        if event is None:
            _LOGGER.warning("%s: room for %d of %d events on the route", network.name, len(drawn), count)
            break
        drawn.append(event)
    return _numbered(drawn, len(vehicles), len(pedestrians))


def missing_events(scenario: Scenario, spec: SceneSpec) -> Iterator[str]:
    """Yield that the route of a drawn scene has no room for all of its events, if the configuration requires them."""
    if spec.drive is None or scenario.drive is None or scenario.drive.events is None:
        return
    drawn, count = len(spec.drive.events), _count(scenario, spec.seed)
    if scenario.drive.events.required and drawn < count:
        yield f"drive.events.required: room for {drawn} of {count} events on the route"


def _count(scenario: Scenario, seed: int) -> int:
    """Number of events that are wanted in a scene."""
    wanted = None if scenario.drive is None else scenario.drive.events
    return 0 if wanted is None else round(sample(wanted.count, stream(seed, "drive_events.count")))


def _free(places: list[Place], drawn: list[_Drawn], spacing_m: float) -> list[Place]:
    """The places that keep their distance from the events drawn so far."""
    return [each for each in places if all(abs(each.at_m - other.place.at_m) >= spacing_m for other in drawn)]


def _draw_event(
    free: Mapping[EventKind, list[Place]],
    weights: Mapping[EventKind, float],
    drawn: list[_Drawn],
    clearance: StartClearance,
    gap_m: float,
    rng: np.random.Generator,
) -> _Drawn | None:
    """Draw a kind by its weight, then one of its places with room for its vehicle; None: there is none.

    SUMO leaves a vehicle out where it would be closer to others on its lane than the gap that they want.
    """
    kinds = list(weights)
    order = np.argsort(rng.exponential(size=len(kinds)) / np.array([weights[kind] for kind in kinds]))
    for kind in (kinds[index] for index in order.tolist()):
        event_class, places = event_classes()[kind], free[kind]
        for index in rng.permutation(len(places)).tolist():
            place = places[index]
            leader = next((each for each in drawn if event_class.places in _LEADING and _leads(each)), None)
            vehicle = _vehicle(event_class, place, rng) if leader is None else leader.vehicle
            if vehicle is not None and vehicle.stands_at is None and leader is None:
                if not clearance.is_free(blueprint_named(vehicle.blueprint), vehicle.start, gap_m):
                    continue
                clearance.occupy(vehicle)
            parameters = {name: float(rng.uniform(*bounds)) for name, bounds in event_class.drawn.items()}
            return _Drawn(kind, place, parameters, vehicle, _pedestrian(event_class, place, parameters, rng))
    return None


def _leads(event: _Drawn) -> bool:
    return event_classes()[event.kind].places in _LEADING


def _vehicle(event_class: EventClass, place: Place, rng: np.random.Generator) -> VehicleSpec | None:
    """Draw the vehicle of an event, in traffic or beside it."""
    if not event_class.vehicles:
        return None
    blueprint = blueprint_named(event_class.vehicles[int(rng.integers(len(event_class.vehicles)))])
    stand, start = None, place.start
    if place.stand is not None:
        x_m, y_m, z_m, yaw_rad = place.stand
        stand = StandSpec(x_m=x_m, y_m=y_m, z_m=z_m, yaw_rad=yaw_rad)
        start = place.walk
    assert start is not None, "a place has a start or a stand"
    return VehicleSpec(
        blueprint=blueprint.name,
        color=blueprint.colors[int(rng.integers(len(blueprint.colors)))],
        start=start,
        speed_factor=1.4 if blueprint.emergency else 1.0,
        min_gap_m=_MIN_GAP_M,
        lane_change_eagerness=0.0,
        ignores=tuple(each for each in event_class.ignores),
        via=place.via,
        emergency_lights=blueprint.emergency,
        stands_at=stand,
    )


def _pedestrian(
    event_class: EventClass, place: Place, parameters: Mapping[str, float], rng: np.random.Generator
) -> PedestrianSpec | None:
    """Draw the pedestrian of an event."""
    if not event_class.people or place.walk is None:
        return None
    blueprint = blueprint_named(event_class.people[int(rng.integers(len(event_class.people)))])
    color = blueprint.colors[int(rng.integers(len(blueprint.colors)))]
    start = WaypointSpec(lane=place.walk.lane, s_m=place.walk.s_m)
    return PedestrianSpec(blueprint=blueprint.name, color=color, start=start, max_speed_mps=parameters["speed_mps"])


def _numbered(drawn: list[_Drawn], first_vehicle: int, first_pedestrian: int) -> DrawnEvents:
    """Events in the order of the route, with the indices of their actors."""
    ordered = sorted(drawn, key=lambda each: each.place.at_m)
    actors = {id(each.vehicle): each.vehicle for each in ordered if each.vehicle is not None}
    vehicles = sorted(actors.values(), key=lambda each: each.stands_at is not None)
    number = {id(each): first_vehicle + index for index, each in enumerate(vehicles)}
    pedestrians: list[PedestrianSpec] = []
    events = []
    for kind, place, parameters, vehicle, pedestrian in ordered:
        walkers = () if pedestrian is None else (first_pedestrian + len(pedestrians),)
        pedestrians += [] if pedestrian is None else [pedestrian]
        events.append(
            EventSpec(
                kind=kind,
                trigger_m=max(place.at_m - event_classes()[kind].notice_m, 0.0),
                vehicles=() if vehicle is None else (number[id(vehicle)],),
                pedestrians=walkers,
                parameters={"at_m": place.at_m, **place.measures, **parameters},
            )
        )
    return DrawnEvents(tuple(events), tuple(vehicles), tuple(pedestrians))
