"""Drawing the events along a route."""

import logging
from itertools import pairwise
from typing import get_args

import pytest

from simbev_ros.config.drive_events import EventName
from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.maps.build import load_network
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene
from simbev_ros.scene.events.kinds import event_classes
from simbev_ros.schema.scene.drive_spec import EventKind
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.world.events.route_events import MOTIONS
from simbev_ros.simulation.world.simulation import Simulation

BLOCKS = map_spec("Blocks")


def drawn(seed: int = 3, **events: object) -> SceneSpec:
    scenario = {
        "seed": seed,
        "scenes": [{"map": "Blocks", "train": 1}],
        "rig": Rig(sensors=()),
        "ego": {"driver": "twist"},
        "traffic": {"vehicles": 10, "pedestrians": 5},
        "hazards": {"count": 2},
        "drive": {"goal_m": 400, "events": events or None},
    }
    return draw_scene(Scenario.model_validate(scenario), PlannedScene(0, BLOCKS, "train"), load_network(BLOCKS))


def test_every_kind_has_a_name_a_class_and_a_motion() -> None:
    assert {*get_args(EventName)} == {kind.value for kind in EventKind}
    assert {*event_classes()} == {*MOTIONS} == {*EventKind}


def test_events_keep_their_distance_and_their_order_and_refer_to_actors_of_their_own() -> None:
    for seed in range(3):
        spec = drawn(seed, count=5, spacing_m=50)
        assert spec.drive is not None
        events = spec.drive.events
        at_m = [event.parameters["at_m"] for event in events]
        assert events and all(after - before >= 50.0 for before, after in pairwise(at_m))
        for event in events:
            event_class = event_classes()[event.kind]
            assert len(event.vehicles) == bool(event_class.vehicles)
            assert len(event.pedestrians) == bool(event_class.people)
            assert all(spec.vehicles[index].blueprint in event_class.vehicles for index in event.vehicles) or any(
                other is not event and {*other.vehicles} & {*event.vehicles} for other in events
            )
            for name, (low, high) in event_class.drawn.items():
                assert low <= event.parameters[name] <= high


def test_events_are_not_in_hazard_areas() -> None:
    for seed in range(4):
        spec = drawn(seed, count=5)
        assert spec.drive is not None and spec.hazards
        blocked = {stretch.lane for hazard in spec.hazards for stretch in hazard.blocked}
        of_events = {index for event in spec.drive.events for index in event.vehicles}
        assert blocked.isdisjoint(spec.vehicles[index].start.lane for index in of_events)


def test_events_change_nothing_else_in_a_scene() -> None:
    without, spec = drawn(), drawn(count=4)
    count = len(without.vehicles)
    standing = [vehicle for vehicle in without.vehicles if vehicle.stands_at is not None]
    driving = count - len(standing)
    assert spec.vehicles[:driving] == without.vehicles[:driving]
    assert spec.vehicles[len(spec.vehicles) - len(standing) :] == tuple(standing)
    assert spec.pedestrians[: len(without.pedestrians)] == without.pedestrians
    assert without.drive is not None and spec.drive is not None and spec.drive.route == without.drive.route
    assert drawn(count=4) == spec


def test_kinds_that_are_asked_for_and_have_no_place_are_named(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        spec = drawn(count=1, kinds=["roundabout"])
    assert spec.drive is not None and not spec.drive.events
    assert "the route has no place for the events roundabout" in caplog.text


def test_a_drive_makes_traffic_yield_and_clears_wrecks() -> None:
    spec = drawn()
    assert spec.yields_to_emergency and spec.wrecks_cleared_s == 30.0


def test_only_kinds_with_weight_are_drawn() -> None:
    spec = drawn(count=3, kinds={"fog_bank": 1.0, "hard_brake": 0.0})
    assert spec.drive is not None
    assert {event.kind for event in spec.drive.events} == {EventKind.FOG_BANK}


@pytest.mark.parametrize("number", range(6))
def test_sumo_has_room_for_the_vehicles_of_events_in_dense_traffic(number: int) -> None:
    scenario = {
        "scenes": [{"map": "Blocks", "train": 6}],
        "rig": Rig(sensors=()),
        "traffic": {"vehicles": 120, "pedestrians": 0, "spawn_radius_m": 150, "min_gap_m": 4.0},
        "drive": {"goal_m": 400, "events": {"count": 4, "kinds": ["blocked_lane", "cut_in", "hard_brake", "merge"]}},
    }
    spec = draw_scene(Scenario.model_validate(scenario), PlannedScene(number, BLOCKS, "train"), load_network(BLOCKS))
    assert spec.drive is not None and spec.drive.events
    with Simulation(spec, load_network(BLOCKS)) as simulation:
        placed = {*simulation._population.vehicles}
    assert {index for event in spec.drive.events for index in event.vehicles} <= placed
