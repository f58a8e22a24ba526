"""Itineraries of pedestrians last as long as the scene, also where their way ends."""

from dataclasses import replace

import pytest
from made_up_roads import made_up_sidewalk

from simbev_ros.foundation.random import stream
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import Lane
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import PedestrianSpec, WaypointSpec
from simbev_ros.simulation.world.pedestrians.itineraries import Itineraries, ItineraryStreams


def sidewalk(name: str, *successors: str) -> Lane:
    return made_up_sidewalk(f"{name}_0", *successors, length_m=50.0)


@pytest.mark.parametrize(
    ("lanes", "passes"),
    [
        ([sidewalk("A")], 22),
        ([sidewalk("A", "B_0"), sidewalk("B")], 22),
        ([sidewalk("A", "B_0"), sidewalk("B", "A_0")], 22),
    ],
    ids=["one sidewalk", "two", "two that meet twice"],
)
def test_pedestrians_walk_up_and_down_where_nothing_else_can_be_reached(lanes: list[Lane], passes: int) -> None:
    network = replace(load_network(MapSpec(name="Blocks")), lanes={lane.id: lane for lane in lanes})
    pedestrian = PedestrianSpec(
        blueprint="pedestrian.man", color=0, start=WaypointSpec(lane="A_0", s_m=20.0), max_speed_mps=1.4
    )
    streams = ItineraryStreams(*(stream(1, name) for name in ("walk", "jaywalks", "plazas")))
    (leg,) = Itineraries(network).draw_legs(pedestrian, 1000.0, streams)
    assert leg.edges[0] == "A" and leg.passes == passes
