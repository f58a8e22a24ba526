"""Long vehicles avoid turns that are too tight for them."""

import numpy as np
import pytest
from made_up_roads import made_up_lane, network_of
from world_scenes import blocks

from simbev_ros.foundation.random import stream
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.blueprints import Blueprint, blueprint_named
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.scene.streets.off_tracking import TurnObstacles, bent_paths, too_tight
from simbev_ros.scene.streets.streets import Streets


def blueprint(name: str) -> Blueprint:
    return blueprint_named(f"vehicle.{name}")


def ring(name: str, radius_m: float, height_m: float = 0.0, kind: LaneKind = LaneKind.DRIVING) -> Lane:
    """A lane of three quarters of a circle, counter-clockwise."""
    angle = np.radians(np.arange(0.0, 271.0))
    line_m = radius_m * np.stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))], axis=-1) + [0, 0, height_m]
    return made_up_lane(name, line_m=line_m, kind=kind)


def fits(body: Blueprint, others: tuple[Lane, ...], sidewalks: tuple[Lane, ...] = ()) -> bool:
    """Whether a vehicle fits through a ring of 20 m radius."""
    lanes = (ring("A_0", 20.0), *others)
    expected = bent_paths(lanes, np.empty((0, 2), np.int64))
    return not too_tight([body.footprint], expected, TurnObstacles(lanes, sidewalks))[0, 0]


def test_a_bus_cuts_a_ring_as_far_as_its_wheelbase_demands():
    bus = blueprint("bus").footprint
    inner_m = np.sqrt(20.0**2 - (bus.lead_m + bus.axle_m) ** 2) - bus.width_m / 2.0  # inner end of the rear axle
    outer_m = np.hypot(inner_m + bus.width_m, bus.axle_m + bus.length_m / 2.0)  # outer end of the front bumper
    for touched_m, side in ((inner_m, -1.0), (outer_m, 1.0)):
        border_m = touched_m + side * (1.75 - 0.6)  # center line of a lane that is then entered by 0.6 m
        assert fits(blueprint("bus"), (ring("B_0", border_m + side * 0.3),))
        assert not fits(blueprint("bus"), (ring("B_0", border_m - side * 0.3),))
        assert fits(blueprint("bus"), (ring("B_0", border_m - side * 0.3, height_m=6.0),))
        assert fits(blueprint("sedan"), (ring("B_0", border_m - side * 0.3),))
        walk_m = touched_m + side * (1.75 - 0.8)
        assert fits(blueprint("bus"), (), (ring("W_0", walk_m + side * 0.3, kind=LaneKind.SIDEWALK),))
        assert not fits(blueprint("bus"), (), (ring("W_0", walk_m - side * 0.3, kind=LaneKind.SIDEWALK),))


def test_a_bus_drives_straight_ahead_where_the_turn_is_too_tight():
    def inside(name: str, line_m: list[list[float]], successor: str) -> Lane:
        return made_up_lane(name, successor, line_m=line_m, junction="j")

    angle = np.linspace(0.0, np.pi / 2.0, 10)
    turn_m = np.stack([100.0 + 6.0 * np.sin(angle), 6.0 * np.cos(angle) - 6.0, 0.0 * angle], axis=-1)
    down_m = np.array([[106.0, -6.0, 0.0], [106.0, -300.0, 0.0]])
    oncoming_m = np.array([[109.5, -300.0, 0.0], [109.5, -6.0, 0.0]])
    onward_m = np.array([[112.0, 0.0, 0.0], [400.0, 0.0, 0.0]])
    roads = network_of(
        blocks(),
        made_up_lane("A_0", ":s_0", ":t_0"),
        inside(":s_0", [[100, 0, 0], [112, 0, 0]], "B_0"),
        inside(":t_0", turn_m.tolist(), "C_0"),
        *(
            made_up_lane(f"{name}_0", line_m=line_m)
            for name, line_m in (("B", onward_m), ("C", down_m), ("D", oncoming_m))
        ),
    )
    streets = Streets(roads)
    for name, expected in (("sedan", {"B", "C"}), ("bus", {"B"})):
        graph = streets.for_blueprint(blueprint(name))
        assert {graph.draw_route("A_0", 100.0, stream(seed, "test"))[1] for seed in range(8)} == expected


@pytest.mark.parametrize("town, min_share", [("Blocks", 0.3), ("Town10HD", 0.6)])
def test_towns_have_room_for_buses(town, min_share):
    roads = blocks() if town == "Blocks" else load_network(map_spec(town))
    usable = StartPositions(roads, 24.0).usable(20.0)
    assert usable["vehicle.bus"].sum() > min_share * usable["vehicle.sedan"].sum()
    assert usable["vehicle.box_truck"].sum() > 0.4 * usable["vehicle.sedan"].sum()
