"""Each kind of event on a small route: it begins in time, does what it promises, and asks the ego to react.

An ego that drives on collides; one that brakes as the event begins does not.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from driven_routes import drive_along
from event_scenes import LEFT, RIGHT, event_scene, town
from world_scenes import TICK_S, blocks

from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import COLLISION, EGO_ID, WorldState
from simbev_ros.simulation.world.events.motion import EgoOnRoute, Stage
from simbev_ros.simulation.world.events.motions import CuttingIn
from simbev_ros.simulation.world.events.route_events import EventRecord
from simbev_ros.simulation.world.simulation import Simulation

NORTH = ("grid.ns2.0.0", "grid.ns2.0.1")
ONE_EDGE = ("grid.ns2.0.1",)
ROUTES = {
    "hard_brake": (ONE_EDGE, 1, 9.0),
    "cut_in": (NORTH, 1, 9.0),
    "blocked_lane": (NORTH, 1, 9.0),
    "hidden_pedestrian": (NORTH, 1, 9.0),
    "red_light_runner": (NORTH, 1, 7.0),
    "unprotected_left": (LEFT, 2, 7.0),
    "merge": (NORTH, 1, 7.0),
    "cyclist_at_right_turn": (RIGHT, 1, 7.0),
}
"""Edges, first lane and speed of the ego."""
QUICK = "hard_brake", "hidden_pedestrian"
KINDS = [pytest.param(kind, marks=() if kind in QUICK else pytest.mark.slow) for kind in ROUTES]


class Run(NamedTuple):
    spec: SceneSpec
    states: list[WorldState]
    record: EventRecord

    @property
    def begin(self) -> int:
        """Row of the first state that can show the event, about 0.5 s after SUMO decided."""
        assert self.record.begin_tick is not None
        return self.record.begin_tick + self.spec.warm_up_ticks

    @property
    def hits_ego(self) -> bool:
        return any(EGO_ID in event.ids for state in self.states for event in state.events)

    def rows(self, number: int) -> np.ndarray:
        """(T,) rows of the actor with the nth id."""
        return np.stack([state.actors[state.actors["id"] == EGO_ID + number][0] for state in self.states])

    def speed_mps(self, number: int) -> Float64Array:
        return np.hypot(self.rows(number)["vx"], self.rows(number)["vy"])


@cache
def run(kind: str, brakes: bool, seed: int = 0) -> Run:
    """The scene of a kind, with an ego that drives on, or brakes for good as the event begins."""
    edges, lane, cruise_mps = ROUTES[kind]

    def speed_mps(state: WorldState, simulation: Simulation) -> float:
        begins = simulation.route_events.records[0].begin_tick is not None
        return 0.0 if brakes and begins and not (kind == "cut_in" and not is_cutting_in(state)) else cruise_mps

    spec = event_scene(kind, edges, lane, seed, ticks=440)
    states, simulation = drive_along(spec, blocks(), speed_mps)
    return Run(spec, states, simulation.route_events.records[0])


@pytest.mark.parametrize(("kind", "tag"), [("hard_brake", Tag.CAR), ("hidden_pedestrian", Tag.PEDESTRIAN)])
def test_begin_and_end_are_events_of_the_world_at_the_position_of_the_ego(kind: str, tag: Tag) -> None:
    passed = run(kind, brakes=True)
    told = [(state, event) for state in passed.states for event in state.events]
    assert [(state.tick, event.type) for state, event in told] == [
        (tick, f"{kind}.{when}")
        for when, tick in (("begin", passed.record.begin_tick), ("end", passed.record.end_tick))
        if tick is not None
    ]
    for state, event in told:
        actors = state.actors[np.isin(state.actors["id"], event.ids)]
        assert tag in actors["tag"] and EGO_ID not in actors["id"]
        assert event.position_m == tuple(float(state.ego[axis]) for axis in "xyz")


def collide(states: list[WorldState]) -> bool:
    return any(event.type == COLLISION for state in states for event in state.events)


def is_cutting_in(state: WorldState) -> bool:
    return bool(abs(state.actors[1]["x"] - state.ego["x"]) < 3.4)


@pytest.mark.parametrize("kind", KINDS)
def test_an_ego_that_drives_on_collides(kind: str) -> None:
    assert run(kind, brakes=False).hits_ego


@pytest.mark.parametrize("kind", KINDS)
def test_an_ego_that_brakes_does_not(kind: str) -> None:
    braking = run(kind, brakes=True)
    assert braking.record.begin_tick is not None
    assert not braking.hits_ego


@pytest.mark.slow
def test_an_event_does_not_begin_before_its_trigger() -> None:
    for kind in ROUTES:
        passive = run(kind, brakes=False)
        assert passive.spec.drive is not None
        drive, half_m = passive.spec.drive, passive.rows(0)["length"][0] / 2.0
        start_m = drive.route.points_m[0, :2]
        ego = passive.rows(0)[min(passive.begin + 10, len(passive.states) - 1)]  # as published, after SUMO's moment
        front_m = float(np.hypot(*(np.array([ego["x"], ego["y"]]) - start_m))) + half_m
        assert front_m > drive.events[0].trigger_m - 2.0, kind


def test_the_vehicle_ahead_brakes_hard() -> None:
    braking = run("hard_brake", brakes=True)
    speed_mps = braking.speed_mps(1)
    change_mps2 = (speed_mps[8:] - speed_mps[:-8]) / (8 * TICK_S)
    assert change_mps2.min() < -6.0
    assert speed_mps[: braking.begin].max() > 5.0 and speed_mps[braking.begin + 60] < 0.1
    assert np.all(np.diff(speed_mps) / TICK_S > -9.0)


@pytest.mark.slow
def test_the_vehicle_that_cuts_in_ends_in_the_lane_of_the_ego_close_ahead() -> None:
    braking = run("cut_in", brakes=True)
    ego, other = braking.rows(0), braking.rows(1)
    aside_m = np.abs(other["x"] - ego["x"])  # the street leads north
    assert aside_m[0] == pytest.approx(3.5, abs=0.2) and aside_m.min() < 0.6
    enters = int(np.argmax(aside_m < 2.0))
    gap_m = other["y"][enters] - ego["y"][enters] - (ego["length"][0] + other["length"][0]) / 2.0
    assert 0.0 < gap_m < 9.0


def test_the_pedestrian_is_hidden_and_then_in_the_lane_when_the_ego_arrives() -> None:
    braking = run("hidden_pedestrian", brakes=True)
    walker, van, ego = braking.rows(2), braking.rows(1), braking.rows(0)
    before = walker[: braking.begin]
    assert np.ptp(before["x"]) < 0.1 and np.ptp(before["y"]) < 0.1
    assert braking.speed_mps(1).max() == 0.0
    lane_m = ego["x"][0]
    assert walker["x"][0] - lane_m > 1.5  # on the sidewalk, to the right
    assert (walker["x"] - lane_m).min() < -3.0  # has crossed
    assert 0.5 < walker["y"][0] - van["y"][0] < 6.0  # beyond the van, as the ego sees it


@pytest.mark.slow
def test_the_blocking_vehicle_stands_with_its_hazard_lights() -> None:
    braking = run("blocked_lane", brakes=True)
    other = braking.rows(1)
    assert braking.speed_mps(1).max() < 0.01
    assert {light & 12 for light in other["lights"][20:].tolist()} == {0, 12}  # both blinkers, bright and dark


def test_the_door_opens_as_the_ego_comes() -> None:
    spec = event_scene("opening_door", NORTH, ticks=440)
    states, simulation = drive_along(spec, blocks(), lambda state, _: 8.0)
    doors = np.array([state.actors[1]["doors"] for state in states])
    assert spec.drive is not None and set(doors.tolist()) == {0, 1}  # at the front left, towards the traffic
    ego, parked = (np.array([state.actors[row]["y"] for state in states]) for row in (0, 1))
    opens = int(np.argmax(doors > 0))
    arrival_s = (parked[opens] - ego[opens] - 2.4) / 8.0
    lead_s = spec.drive.events[0].parameters["lead_s"]
    assert arrival_s == pytest.approx(lead_s, abs=0.15)
    assert simulation.route_events.records[0].end_tick is not None


@pytest.mark.slow
def test_the_slow_vehicle_crawls_on_the_bend() -> None:
    spec = event_scene("slow_vehicle", ("grid.ring.7", "grid.ring.8"), ticks=640)
    states, simulation = drive_along(spec, blocks(), lambda state, _: 7.0)
    record = simulation.route_events.records[0]
    assert spec.drive is not None and record.begin_tick is not None
    speed_mps = np.array([np.hypot(state.actors[1]["vx"], state.actors[1]["vy"]) for state in states])
    crawl_mps = spec.drive.events[0].parameters["speed_mps"]
    assert speed_mps[record.begin_tick + spec.warm_up_ticks + 110] == pytest.approx(crawl_mps, abs=0.3)


@pytest.mark.slow
def test_the_emergency_vehicle_is_blocked_by_an_ego_in_its_lane_and_passes_one_that_gives_way() -> None:
    ahead_m = []
    for gives_way_m in (0.0, 3.5):
        spec = event_scene("emergency_vehicle", ONE_EDGE, ticks=640, yields_to_emergency=True)
        states, simulation = drive_along(spec, blocks(), lambda state, _: 2.5, gives_way_m)
        assert simulation.route_events.records[0].begin_tick is not None
        lights = {int(state.actors[1]["lights"]) & 32 for state in states}
        assert lights == {0, 32} and not collide(states)
        ahead_m.append(np.array([state.actors[1]["y"] - state.ego["y"] for state in states]))
    assert ahead_m[0][0] < -20.0 and ahead_m[0].max() < -4.0 and ahead_m[1].max() > 10.0


@pytest.mark.slow
def test_the_fog_bank_comes_and_goes_with_the_route() -> None:
    spec = event_scene("fog_bank", NORTH, ticks=560)
    states, simulation = drive_along(spec, blocks(), lambda state, _: 8.0)
    record, fog = simulation.route_events.records[0], np.array([state.weather.fog_density for state in states])
    assert spec.drive is not None and record.begin_tick is not None
    density = spec.drive.events[0].parameters["fog_density"]
    begin = record.begin_tick + spec.warm_up_ticks
    assert np.all(fog[:begin] == 0.0) and fog.max() == pytest.approx(density)


@pytest.mark.slow
def test_a_vehicle_on_the_ring_meets_the_ego_at_the_entry_of_a_roundabout() -> None:
    spec = event_scene("roundabout", ("-east_avenue", "circus.0"), lane=2, s_m=110.0, ticks=440, town_name="Town03")
    assert spec.drive is not None and spec.vehicles[1].start.lane.startswith("circus.")
    drives, stops = (
        drive_along(spec, town("Town03"), speed_mps)
        for speed_mps in (
            lambda state, _: 7.0,
            lambda state, simulation: 7.0 * (simulation.route_events.records[0].begin_tick is None),
        )
    )
    assert collide(drives[0])
    assert not collide(stops[0])


@pytest.mark.slow
def test_the_same_scene_gives_the_same_bytes() -> None:
    first, second = run("red_light_runner", False), run.__wrapped__("red_light_runner", False)
    assert [state.actors.tobytes() for state in first.states] == [state.actors.tobytes() for state in second.states]


@pytest.mark.parametrize(
    ("ego_mps", "snow_cover", "braking_mps2"), [(6.0, 0.0, 4.0), (20.0, 0.0, 4.0), (20.0, 100.0, 1.25)]
)
def test_an_ego_that_needs_it_has_more_room_to_brake_for_what_cuts_in(
    ego_mps: float, snow_cover: float, braking_mps2: float
) -> None:
    """The other one rolls at 5 m/s; what is closed while the ego brakes is added to the gap of 8 m."""
    given = SimpleNamespace(set_speed=lambda *_: None, move_aside=lambda *_: moved.append(1))
    sumo = SimpleNamespace(given=given, limit_speed=lambda *_: None, speed_mps=lambda _: 5.0)
    event = SimpleNamespace(parameters={"gap_m": 8.0, "left_m": 3.5, "speed_share": 5.0 / ego_mps})
    wanted_m = 8.0 + (ego_mps - 5.0) ** 2 / (2.0 * braking_mps2)
    road = SimpleNamespace(wetness=0.0, precipitation_deposits=0.0, snow_cover=snow_cover)
    weather = SimpleNamespace(at=lambda _: road)
    for more_m, changes in ((0.1, False), (-0.1, True)):
        moved: list[int] = []
        stage: Any = Stage
        motion = CuttingIn(stage(event, sumo, None, weather, lambda: 0, TICK_S, (3,), ()))
        motion.advance(EgoOnRoute(50.0, ego_mps, 0.0), np.array([55.0 + wanted_m + more_m]))
        assert bool(moved) is changes
