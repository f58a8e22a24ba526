"""Entities that commands place: analytic motion, what hangs on them, contacts; in traffic, which heeds them."""

import numpy as np
import pytest
from scene_edits import ego
from several_agents import with_agents
from test_agents_in_traffic import on_longest_lane
from world_scenes import NOON, TICK_S, blocks, scene

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.transforms import rotations_from_rpy
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.scene.blueprints import blueprint_named, load_blueprints
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, COLLISION, EGO_ID, Light, WorldState
from simbev_ros.simulation.world import entities as module
from simbev_ros.simulation.world.entities import DELETED, MOVED, SPAWNED, Entities, EntityMotion
from simbev_ros.simulation.world.simulation import Simulation

SEDAN = blueprint_named("vehicle.sedan")
OTHERS = np.zeros(3, ACTOR_DTYPE)
OTHERS["id"], OTHERS["x"], OTHERS["length"], OTHERS["width"], OTHERS["height"] = [1, 2, 5], [0, 30, 60], 4.0, 2.0, 1.5


def motion(x_m: float = 0.0, y_m: float = 0.0, yaw_rad: float = 0.0, **changes: list[float]) -> EntityMotion:
    vectors = {name: np.array(value) for name, value in changes.items()}
    return EntityMotion(np.array([x_m, y_m, 0.0]), rotations_from_rpy(np.array([0.0, 0.0, yaw_rad])), **vectors)


def entity_row(entities: Entities, actor: int) -> Table:
    rows = entities.overlay(OTHERS)
    return rows[rows["id"] == actor][0]


def advance(entities: Entities, ticks: int) -> Table:
    for _ in range(ticks):
        entities.advance_entities(NOON)
    return entities.overlay(OTHERS)


def test_an_entity_is_at_the_given_pose_at_the_next_tick_and_then_moves_with_constant_acceleration() -> None:
    entities = Entities(TICK_S, first_id=10)
    actor = entities.spawn(SEDAN, motion(10.0, 20.0, velocity_mps=[2.0, -1.0, 0.0], acceleration_mps2=[0.5, 0.0, 0.0]))
    assert actor == 10
    advance(entities, 1)
    row = entity_row(entities, 10)
    assert (row["x"], row["y"], row["vx"], row["ax"]) == (10.0, 20.0, 2.0, 0.5)
    advance(entities, 40)
    row = entity_row(entities, 10)
    np.testing.assert_allclose([row["x"], row["y"]], [10.0 + 2.0 * 2.0 + 0.25 * 4.0, 20.0 - 2.0], atol=1e-9)
    np.testing.assert_allclose([row["vx"], row["vy"]], [3.0, -1.0], atol=1e-6)


def test_angular_velocity_turns_an_entity_about_its_own_origin() -> None:
    entities = Entities(TICK_S, 10)
    entities.spawn(SEDAN, motion(5.0, yaw_rad=0.3, rates_radps=[0.0, 0.0, 0.5]))
    advance(entities, 21)
    row = entity_row(entities, 10)
    assert row["yaw"] == pytest.approx(0.3 + 0.5, abs=1e-6)
    assert (row["x"], row["y"], row["roll"], row["pitch"], row["wz"]) == (5.0, 0.0, 0.0, 0.0, 0.5)


def test_tables_stay_sorted_and_other_actors_as_they_are() -> None:
    entities = Entities(TICK_S, 10)
    assert entities.overlay(OTHERS) is OTHERS
    entities.spawn(SEDAN, motion(100.0))
    entities.adopt(OTHERS[1:2], np.zeros((1, 3)))
    entities.place(2, motion(7.0, 8.0))
    rows = advance(entities, 1)
    assert rows["id"].tolist() == [1, 2, 5, 10]
    assert rows[0] == OTHERS[0] and rows[2] == OTHERS[2]
    assert (rows["x"][1], rows["y"][1], rows["length"][1]) == (7.0, 8.0, 4.0)
    entities.delete(2)
    assert entities.overlay(OTHERS)["id"].tolist() == [1, 5, 10]
    assert entities.spawned == {10}


def test_a_rider_and_a_trailer_come_and_go_with_their_vehicle() -> None:
    bicycle = next(each for each in load_blueprints() if each.rider)
    tractor = next(each for each in load_blueprints() if each.tows)
    entities = Entities(TICK_S, 10)
    first = entities.spawn(bicycle, motion(100.0, 0.0, np.pi / 2.0, velocity_mps=[0.0, 3.0, 0.0]))
    second = entities.spawn(tractor, motion(200.0))
    rows = advance(entities, 2)
    rider, trailer = rows[rows["parent"] == first][0], rows[-1]
    seat_m = bicycle.rider_seat_m
    np.testing.assert_allclose([rider["x"], rider["y"], rider["z"]], [100.0 - seat_m[1], 0.15 + seat_m[0], seat_m[2]])
    assert rider["lights"] == 0 and rows["lights"][3] & Light.BRAKE == 0 and rows["lights"][5] & Light.BRAKE
    towed = blueprint_named(tractor.tows)
    assert trailer["x"] == pytest.approx(200.0 + tractor.hitch_m - towed.hitch_m) and trailer["parent"] == 0
    assert rows["id"][3:].tolist() == [first, first + 1, second, second + 1]
    entities.delete(first)
    entities.delete(second)
    assert entities.overlay(OTHERS)["id"].tolist() == [1, 2, 5]
    assert entities.spawn(SEDAN, motion()) == second + 2, "ids are not used twice"


def test_wheels_and_legs_turn_with_the_distance() -> None:
    walker = next(each for each in load_blueprints() if each.on_foot)
    entities = Entities(TICK_S, 10)
    entities.spawn(SEDAN, motion(100.0, velocity_mps=[4.0, 0.0, 0.0]))
    entities.spawn(walker, motion(200.0, velocity_mps=[1.2, 0.0, 0.0]))
    rows = advance(entities, 11)
    assert rows["wheel"][3] == pytest.approx(2.0 / SEDAN.wheel_radius_m)
    assert 0.0 < rows["gait"][4] < 2.0 * np.pi
    assert not rows["lights"][3] & Light.BRAKE


def test_heights_follow_the_ground_unless_a_vertical_motion_is_given() -> None:
    def slope_m(point_m: Float64Array) -> Float64Array:
        return 0.1 * point_m[:, 0]

    entities = Entities(TICK_S, 10, slope_m)
    entities.spawn(SEDAN, motion(100.0, velocity_mps=[2.0, 0.0, 0.0]))
    entities.spawn(SEDAN, motion(100.0, 50.0, velocity_mps=[2.0, 0.0, 1.0]))
    rows = advance(entities, 21)
    np.testing.assert_allclose(rows["z"][3:], [0.2, 1.0])


def test_commands_and_first_contacts_are_events() -> None:
    entities = Entities(TICK_S, 10)
    entities.spawn(SEDAN, motion(20.0, velocity_mps=[10.0, 0.0, 0.0]))
    seen = []
    for tick in range(30):
        entities.advance_entities(NOON)
        entities.note_contacts(entities.overlay(OTHERS))
        seen += [(tick, event.type, event.ids) for event in entities.events]
    gap_m = 30.0 - 2.0 - 20.0 - SEDAN.size_m[0] / 2.0
    assert seen == [(0, SPAWNED, (10,)), (int(np.floor(gap_m / 10.0 / TICK_S)) + 1, COLLISION, (2, 10))]
    entities.place(10, motion(-50.0))
    entities.advance_entities(NOON)
    assert [(event.type, event.position_m) for event in entities.events] == [(MOVED, (-50.0, 0.0, 0.0))]
    entities.delete(10)
    entities.advance_entities(NOON)
    assert [event.type for event in entities.events] == [DELETED]


def test_the_number_of_entities_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_ENTITIES", 1)
    entities = Entities(TICK_S, 10)
    entities.spawn(SEDAN, motion())
    with pytest.raises(InputError, match=r"a scene can have 1 entities that were spawned or moved"):
        entities.spawn(SEDAN, motion())
    with pytest.raises(InputError, match=r"a scene can have 1 entities"):
        entities.require_room()


def street(vehicles: int = 2, pedestrians: int = 0, ticks: int = 300) -> SceneSpec:
    """The ego at the start of the longest lane, another car far ahead of it."""
    spec = scene(vehicles=vehicles, pedestrians=pedestrians, ticks=ticks, agents=[ego()])
    placed = tuple(map(on_longest_lane, spec.vehicles[:2], (20.0, 100.0)))
    return with_agents(spec.model_copy(update={"vehicles": (*placed, *spec.vehicles[2:])}))


def motion_ahead(state: WorldState, distance_m: float) -> EntityMotion:
    """Standing in the ego's direction, some distance ahead of its center."""
    placed = EntityMotion.of_row(state.ego)
    placed.position_m += distance_m * placed.rotation[:, 0]
    placed.velocity_mps, placed.rates_radps = np.zeros(3), np.zeros(3)
    return placed


def test_traffic_stops_behind_a_spawned_vehicle_and_drives_on_when_it_is_deleted() -> None:
    spec = street(vehicles=1)
    with Simulation(spec, blocks()) as simulation:
        for _ in range(spec.warm_up_ticks):
            state = simulation.step()
        actor = simulation.entities.spawn(SEDAN, motion_ahead(state, 35.0))
        states = [simulation.step() for _ in range(200)]
        assert states[0].actors["id"][-1] == actor
        gap_m = states[-1].distance_to_ego_m[-1] - (SEDAN.size_m[0] + states[-1].ego["length"]) / 2.0
        assert 0.0 < gap_m < 6.0
        assert np.hypot(states[-1].ego["vx"], states[-1].ego["vy"]) < 0.1
        assert all(event.type != COLLISION for each in states for event in each.events)
        simulation.entities.delete(actor)
        for _ in range(100):
            state = simulation.step()
        assert np.hypot(state.ego["vx"], state.ego["vy"]) > 3.0


def test_an_entity_may_leave_the_roads_and_come_back() -> None:
    spec = street(vehicles=1)
    with Simulation(spec, blocks()) as simulation:
        for _ in range(spec.warm_up_ticks):
            state = simulation.step()
        actor = simulation.entities.spawn(SEDAN, motion_ahead(state, 35.0))
        for position in (motion_ahead(state, 35.0), motion(500.0, 500.0), motion_ahead(state, 35.0)):
            simulation.entities.place(actor, position)
            simulation.step()
        states = [simulation.step() for _ in range(200)]
    assert states[-1].distance_to_ego_m[-1] < 10.0
    assert np.hypot(states[-1].ego["vx"], states[-1].ego["vy"]) < 0.1, "the ego waits behind it again"


def test_traffic_does_not_heed_an_entity_far_below_the_road() -> None:
    spec = street(vehicles=1)
    with Simulation(spec, blocks()) as simulation:
        for _ in range(spec.warm_up_ticks):
            state = simulation.step()
        below = motion_ahead(state, 35.0)
        below.position_m[2] = -20.0
        simulation.entities.spawn(SEDAN, below)
        states = [simulation.step() for _ in range(200)]
    assert np.hypot(states[-1].ego["x"] - states[0].ego["x"], states[-1].ego["y"] - states[0].ego["y"]) > 60.0


def test_an_entity_may_stand_on_the_pavement_where_people_wait_at_a_junction() -> None:
    spec = scene(vehicles=24, pedestrians=0)
    with Simulation(spec, blocks()) as simulation:
        state = simulation.step()
        actor = simulation.entities.spawn(SEDAN, motion(25.1, 216.3, np.pi / 2.0))  # its front is beyond the road
        states = [state, *(simulation.step() for _ in range(5))]
    assert states[-1].actors["y"][states[-1].actors["id"] == actor] == pytest.approx(216.3)


def test_an_actor_of_the_traffic_that_is_moved_or_deleted_leaves_the_road() -> None:
    spec = street(pedestrians=4)
    with Simulation(spec, blocks()) as simulation:
        for _ in range(spec.warm_up_ticks):
            state = simulation.step()
        walker = int(state.actors["id"][-1])
        simulation.adopt_entity(walker, state.actors)
        simulation.entities.delete(walker)
        simulation.adopt_entity(EGO_ID + 1, state.actors)
        simulation.entities.place(EGO_ID + 1, motion(500.0, 500.0))
        states = [simulation.step() for _ in range(200)]
    for each in states:
        row = each.actors[each.actors["id"] == EGO_ID + 1][0]
        assert (row["x"], row["y"], row["vx"], row["blueprint"]) == (500.0, 500.0, 0.0, state.actors["blueprint"][1])
        assert walker not in each.actors["id"] and (np.diff(each.actors["id"].astype(int)) > 0).all()
    assert [event.type for event in states[0].events] == [DELETED, MOVED]
    driven_m = np.hypot(*(states[-1].ego[axis] - states[0].ego[axis] for axis in ("x", "y")))
    assert driven_m > 30.0, "the ego is not held up by the vehicle that has left"


def test_the_ego_is_moved_from_outside_like_any_other_actor() -> None:
    spec = street(pedestrians=2)
    with Simulation(spec, blocks()) as simulation:
        for _ in range(spec.warm_up_ticks):
            state = simulation.step()
        simulation.adopt_entity(EGO_ID, state.actors)
        simulation.entities.place(EGO_ID, motion(3.0, 4.0, velocity_mps=[2.0, 0.0, 0.0]))
        egos = [simulation.step().ego for _ in range(60)]
    np.testing.assert_allclose([ego_row["x"] for ego_row in egos], 3.0 + 2.0 * TICK_S * np.arange(60), atol=1e-9)
    assert {float(ego_row["vx"]) for ego_row in egos} == {2.0}


def test_the_same_commands_at_the_same_ticks_lead_to_the_same_tables() -> None:
    tables = []
    for _ in range(2):
        spec = street(vehicles=6, pedestrians=4)
        with Simulation(spec, blocks()) as simulation:
            for _ in range(spec.warm_up_ticks):
                state = simulation.step()
            simulation.entities.spawn(SEDAN, motion_ahead(state, 30.0))
            simulation.adopt_entity(EGO_ID + 2, state.actors)
            simulation.entities.place(EGO_ID + 2, motion_ahead(state, 60.0))
            tables.append(b"".join(simulation.step().actors.tobytes() for _ in range(150)))
    assert tables[0] == tables[1]
