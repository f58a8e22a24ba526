"""SUMO's traffic demand for one scene: vehicles and pedestrians with types, routes and starts, as route file XML.

Names: vehicle k of the specification is ``v<k>``, pedestrian k is ``p<k>``.
"""

import math
from collections.abc import Mapping, Sequence, Set
from typing import NamedTuple
from xml.etree import ElementTree

from simbev_ros.assets.land.plazas import Plaza
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.streets.vehicle_route import draw_vehicle_route
from simbev_ros.schema.scene.spec import Ignored, PedestrianSpec, SceneSpec, VehicleSpec
from simbev_ros.simulation.world.driving.rain import RainEffect, rain_effect
from simbev_ros.simulation.world.pedestrians.crossing_sites import CrossingSite
from simbev_ros.simulation.world.pedestrians.itineraries import Itineraries, ItineraryStreams, Leg
from simbev_ros.simulation.world.pedestrians.pauses import draw_pauses
from simbev_ros.simulation.world.sumo.closures import add_closures
from simbev_ros.simulation.world.sumo.names import pedestrian_name, vehicle_name
from simbev_ros.simulation.world.sumo.tracks import LaneTracks

_FOREVER_S = "1e8"
_START_MARGIN_M = 0.1
_SIDE_MARGIN_M = 0.2
_ABREAST_M = 0.7  # distance between the members of a group, who walk side by side
_TURNS = ("-0.1", "0.1")  # where pedestrians turn back at an edge's end, of which SUMO counts back, and its start
_JUDGED_MPS2 = 2.4  # acceleration up to which nuPlan's score finds a drive comfortable
_MIN_WIDTH_M = 1.2  # minimum width in SUMO: bicycles keep off curbs, and cars keep off bicycles
_TYPE = {"speedDev": "0"}
_DRIVER = {
    **_TYPE,
    "carFollowModel": "IDM",  # of SUMO's crash-free models, the one with the smoothest accelerations
    "lcMaxSpeedLatStanding": "0",  # standing vehicles do not move sideways
    "lcMaxSpeedLatFactor": "0.5",
}
# A reckless driver ignores lights, signs, vehicles and pedestrians at junctions, but not leaders on the same lane.
_RECKLESS = {
    "jmDriveAfterRedTime": _FOREVER_S,
    "jmDriveAfterYellowTime": _FOREVER_S,
    "jmIgnoreFoeProb": "1",
    "jmIgnoreFoeSpeed": "1000",
    "jmIgnoreJunctionFoeProb": "1",
    "impatience": "1",
}
# Other drivers ignore some of these. A distracted one ignores lights and stop signs, but yields to other road users.
_IGNORING: dict[Ignored, dict[str, str]] = {
    "lights": {"jmDriveAfterRedTime": _FOREVER_S, "jmDriveAfterYellowTime": _FOREVER_S},
    "signs": {"jmStopSignWait": "0", "jmAllwayStopWait": "0"},
}
_OF_EMERGENCY: frozenset[Ignored] = frozenset({"lights", "signs", "vehicles"})


class Demand(NamedTuple):
    """SUMO's input for a scene.

    Attributes:
        xml: The route file.
        edges: Ids of all edges that are used.
        excursions: Legs of the pedestrians that leave SUMO's network, by index in the specification.
    """

    xml: str
    edges: Set[str]
    excursions: Mapping[int, tuple[Leg, ...]]


def demand_of(spec: SceneSpec, network: RoadNetwork, plazas: Sequence[Plaza] = ()) -> Demand:
    """Assemble the traffic demand of a scene on a network with plazas that pedestrians may visit.

    Raises:
        SimulationError: A vehicle starts where its class may not drive.
    """
    duration_s = (spec.warm_up_ticks + spec.ticks) * spec.tick_ns / NS_PER_S
    start_edges = {network.lanes[vehicle.start.lane].edge for vehicle in spec.drivers}
    tracks = LaneTracks([lane for lane in network.lanes.values() if lane.edge in start_edges])
    rain = rain_effect(spec.weather)
    root = ElementTree.Element("routes")
    edges: set[str] = set()
    for index, vehicle in enumerate(spec.drivers):
        route = draw_vehicle_route(spec, network, index)
        lane = network.lanes[vehicle.start.lane]
        start_m = tracks.sumo_position_m(lane.id, min(vehicle.start.s_m, lane.length_m - _START_MARGIN_M))
        edges.update(route.edges)
        ignores = _ignored(spec, vehicle)
        element = _add_vehicle(root, vehicle_name(index), vehicle, ignores, rain, route.edges, start_m)
        if not vehicle.reckless and (ignored := _ignored_types(spec, ignores)):
            ElementTree.SubElement(element, "param", {"key": "junctionModel.ignoreTypes", "value": " ".join(ignored)})
        if spec.drive is not None and index == 0:
            root[-2].set("accel", f"{min(blueprint_named(vehicle.blueprint).accel, _JUDGED_MPS2):g}")
        if _has_way(spec, vehicle):  # the others change lanes
            root[-2].attrib |= {"lcSpeedGain": "0", "lcKeepRight": "0", "lcCooperative": "0"}
        if route.ends:
            ElementTree.SubElement(element, "stop", {"edge": route.edges[-1], "duration": _FOREVER_S})
    itineraries = Itineraries(network, spec.hazards, plazas)
    excursions: dict[int, tuple[Leg, ...]] = {}
    for index, pedestrian in enumerate(spec.pedestrians):
        leader = spec.leader_of(index)
        streams = ItineraryStreams(
            *(stream(spec.seed, f"{pedestrian_name(leader)}.{name}") for name in ("walk", "jaywalks", "plazas"))
        )
        lane = network.lanes[pedestrian.start.lane]
        side = float(streams.walk.uniform(-1.0, 1.0))
        if next(draw_pauses(spec, leader), (math.inf,))[0] == 0.0:  # stands at one edge of the sidewalk
            side = math.copysign(1.0, side)
        side_m = (lane.width_m / 2.0 - _SIDE_MARGIN_M) * side
        side_m -= math.copysign(_ABREAST_M * (index - leader), side)
        legs = itineraries.draw_legs(pedestrian, duration_s * pedestrian.max_speed_mps, streams)
        start_m = min(pedestrian.start.s_m, lane.length_m - _START_MARGIN_M) * lane.sumo_s_per_m
        for leg in legs:
            edges.update(leg.edges)
            if isinstance(leg.excursion, CrossingSite):
                edges.update(part.edge for part in leg.excursion.carriageways)
            if leg.excursion is not None:
                excursions[index] = legs
        _add_pedestrian(root, pedestrian_name(index), pedestrian, legs[0], start_m, side_m)
    edges |= add_closures(root, spec, network)
    return Demand(ElementTree.tostring(root, encoding="unicode"), edges, excursions)


def _add_vehicle(
    root: ElementTree.Element,
    name: str,
    vehicle: VehicleSpec,
    ignored: Set[Ignored],
    rain: RainEffect,
    route: tuple[str, ...],
    start_m: float,
) -> ElementTree.Element:
    """Add one vehicle, at rest with its front bumper at its start, and its own type; returns the vehicle's element."""
    blueprint = blueprint_named(vehicle.blueprint)
    _, width_m, height_m = blueprint.size_m
    own = {
        "id": name,
        "vClass": blueprint.sumo_class,
        "length": f"{blueprint.train_length_m:g}",
        "width": f"{max(width_m, _MIN_WIDTH_M):g}",
        "height": f"{height_m:g}",
        "accel": f"{blueprint.accel:g}",
        "decel": f"{blueprint.decel:g}",
        "maxSpeed": f"{blueprint.max_speed_mps:g}",
        "desiredMaxSpeed": f"{blueprint.max_speed_mps:g}",
        "minGap": repr(vehicle.min_gap_m),
        "speedFactor": repr(vehicle.speed_factor * rain.speed),
        "tau": repr(vehicle.headway_s * rain.headway),
        "lcSpeedGain": repr(vehicle.lane_change_eagerness),
        "latAlignment": "right" if blueprint.sumo_class == "bicycle" else "center",
    }
    behavior: dict[str, str] = {}
    for what, attributes in _IGNORING.items():
        behavior |= attributes if what in ignored else {}
    ElementTree.SubElement(root, "vType", {**_DRIVER, **own, **(_RECKLESS if vehicle.reckless else behavior)})
    start = {
        "depart": "0",
        "departLane": vehicle.start.lane.rsplit("_", 1)[1],
        "departPos": repr(start_m),
        "departSpeed": "0",
        "insertionChecks": "collision",
    }
    element = ElementTree.SubElement(root, "vehicle", {"id": name, "type": name, **start})
    ElementTree.SubElement(element, "route", {"edges": " ".join(route)})
    return element


def _ignored(spec: SceneSpec, vehicle: VehicleSpec) -> Set[Ignored]:
    """What SUMO's driver ignores on junctions; for emergency vehicles, others make way there."""
    return vehicle.ignored | _OF_EMERGENCY if _has_way(spec, vehicle) else vehicle.ignored


def _has_way(spec: SceneSpec, vehicle: VehicleSpec) -> bool:
    """Whether the others make way for a vehicle."""
    return spec.yields_to_emergency and vehicle.emergency_lights


def _ignored_types(spec: SceneSpec, ignored: Set[Ignored]) -> list[str]:
    """Types of vehicles and pedestrians that a driver ignores on junctions."""
    kinds = {"vehicles": (vehicle_name, spec.drivers), "pedestrians": (pedestrian_name, spec.pedestrians)}
    return [
        name_of(index) for what, (name_of, actors) in kinds.items() if what in ignored for index in range(len(actors))
    ]


def _add_pedestrian(
    root: ElementTree.Element,
    name: str,
    pedestrian: PedestrianSpec,
    leg: Leg,
    start_m: float,
    side_m: float,
) -> None:
    """Add one pedestrian, ``start_m`` along the sidewalk and ``side_m`` to the left of its center line."""
    length_m, width_m, height_m = blueprint_named(pedestrian.blueprint).size_m
    own = {
        "id": name,
        "vClass": "pedestrian",
        "length": f"{length_m:g}",
        "width": f"{width_m:g}",
        "height": f"{height_m:g}",
        "maxSpeed": repr(pedestrian.max_speed_mps),
        "desiredMaxSpeed": repr(pedestrian.max_speed_mps),
        "speedFactor": "1",
    }
    ElementTree.SubElement(root, "vType", {**_TYPE, **own})
    start = {"id": name, "type": name, "depart": "0", "departPos": repr(start_m)}
    person = ElementTree.SubElement(root, "person", start)
    walk = {"edges": " ".join(leg.edges), "departPosLat": repr(side_m)}
    arrival = {} if leg.arrival_m is None else {"arrivalPos": repr(leg.arrival_m)}
    ElementTree.SubElement(person, "walk", {**walk, **arrival})
    for number in range(leg.passes):
        ElementTree.SubElement(person, "walk", {"edges": leg.edges[-1], "arrivalPos": _TURNS[number % 2]})
    ElementTree.SubElement(person, "stop", {"edge": leg.edges[-1], "duration": _FOREVER_S})
