"""Draw the events along a route: what happens when the first agent comes by, and the actors that only events have."""

from typing import NamedTuple

from simbev_ros.config.scenario import Scenario
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.drawing.start_clearance import StartClearance
from simbev_ros.schema.scene.drive_spec import EventSpec, RouteSpec
from simbev_ros.schema.scene.spec import PedestrianSpec, VehicleSpec


class DrawnEvents(NamedTuple):
    """Events in the order of the route, and the actors that are added to the scene for them."""

    events: tuple[EventSpec, ...] = ()
    vehicles: tuple[VehicleSpec, ...] = ()
    pedestrians: tuple[PedestrianSpec, ...] = ()


def draw_events(
    scenario: Scenario,
    seed: int,
    network: RoadNetwork,
    route: RouteSpec,
    vehicles: tuple[VehicleSpec, ...],
    pedestrians: tuple[PedestrianSpec, ...],
    clearance: StartClearance,
) -> DrawnEvents:
    """Draw the events of a scene's route, each with streams of its own. There are none yet.

    Args:
        scenario: The configuration.
        seed: Seed of the scene.
        network: Roads of the scene's map.
        route: The route of the first agent.
        vehicles: Vehicles drawn so far, the first agent's first; the vehicles of events follow them in the scene.
        pedestrians: Pedestrians drawn so far; those of events follow them.
        clearance: The ground that vehicles occupy, to which those of events are added.
    """
    return DrawnEvents()
