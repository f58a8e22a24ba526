"""Messages between agents: who sends what, and what arrives where and when."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from made_up_scene import made_up_spec
from several_agents import car, roadside_unit, with_agents
from synthetic_world import TICK_NS, actor, box_model, world

from simbev_ros.foundation.semantics import BOX_CLASSES, Tag
from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.schema.boxes import NO_CLASS, blank_boxes
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID, WorldState
from simbev_ros.schema.scene.v2x_spec import V2xSpec
from simbev_ros.schema.v2x import boxes_of_messages
from simbev_ros.simulation.annotation.v2x import Exchange, V2xNetwork, message_of

CAR_ID, RSU_ID = EGO_ID + 1, 0x30001
EXACT = {"rate_hz": 20, "latency_s": 0.0, "range_m": 100.0}
SEDAN = [blueprint.name for blueprint in load_blueprints()].index("vehicle.sedan")
CAR = BOX_CLASSES.index("car")
AGENTS = ["ego", "car", "rsu"]


def scene_with(**settings: Any) -> SceneSpec:
    """A scene of ``ego``, ``car`` and ``rsu``, which send each other messages."""
    spec = with_agents(made_up_spec([]), car("car", 1, []), roadside_unit(sensors=[], x_m=30.0, y_m=40.0))
    v2x = {"agents": AGENTS} | EXACT | settings
    return SceneSpec.model_validate(spec.model_dump(mode="json") | {"v2x": v2x})


def settings_of(spec: SceneSpec) -> V2xSpec:
    assert spec.v2x is not None
    return spec.v2x


def state_at(tick: int, gap_m: float = 50.0) -> WorldState:
    """The ego in the origin, and the car ahead of it."""
    model = box_model(Tag.CAR, (4.0, 2.0, 1.5))
    ego = actor(model, SEDAN, id=EGO_ID, yaw=0.5, vx=3.0)
    return replace(world(ego, actor(model, SEDAN, id=CAR_ID, x=gap_m, pitch=0.3), tick=tick), ego_id=EGO_ID)


def boxes_at(*ids: int, **columns: Any) -> Table:
    rows = blank_boxes(len(ids))
    rows["id"], rows["x"], rows["class"], rows["lidar_points"] = ids, 10.0 * np.array(ids), CAR, 5
    for name, values in columns.items():
        rows[name] = values
    return rows


def network_of(spec: SceneSpec) -> V2xNetwork:
    return V2xNetwork(spec, settings_of(spec))


def play(spec: SceneSpec, ticks: int, gap_m: float = 50.0) -> list[Exchange]:
    network = network_of(spec)
    boxes = {"ego": boxes_at(7, 9), "car": boxes_at(9), "rsu": boxes_at()}
    return [network.exchange(state_at(tick, gap_m), boxes) for tick in range(ticks)]


def arrivals(exchanges: list[Exchange], receiver: str, sender_id: int) -> list[tuple[int, int]]:
    """Tick of arrival and of sending of each message."""
    return [
        (tick, sent)
        for tick, exchange in enumerate(exchanges)
        for sender, id_, sent in exchange.arrived[receiver][["sender", "id", "tick"]].tolist()
        if sender == sender_id and id_ == 0
    ]


def test_a_message_tells_the_senders_pose_and_then_the_boxes_that_it_sees() -> None:
    spec = scene_with()
    rows = play(spec, 1)[0].sent["ego"]
    assert rows["sender"].tolist() == [EGO_ID] * 3
    assert rows["id"].tolist() == [0, 7, 9]
    assert rows["tick"].tolist() == [0, 0, 0]
    own = rows[0]
    assert [own[name].item() for name in ("x", "y", "z", "vx", "length", "class")] == [0, 0, 0, 3, 4, CAR]
    assert own["yaw"] == np.float32(0.5)
    assert (own["lidar_points"], own["radar_points"]) == (-1, -1) and np.isnan(own["visibility"])
    for name in ("x", "class", "lidar_points", "radar_points"):
        assert rows[name][1:].tolist() == boxes_at(7, 9)[name].tolist()


def test_a_roadside_unit_tells_the_pose_of_its_mast() -> None:
    rows = play(scene_with(), 1)[0].sent["rsu"]
    assert rows[["sender", "id", "class", "x", "y", "z", "length"]].tolist() == [(RSU_ID, 0, NO_CLASS, 30, 40, 1, 0)]
    assert len(boxes_of_messages(rows)) == 0


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({}, [1, 2, 4, 5]),
        ({"min_points": 3}, [2, 4, 5]),
        ({"min_points": None}, [4, 5]),
        ({"min_visibility": 0.5}, [1, 2, 5]),
        ({"min_visibility": None}, [1, 2]),
        ({"min_points": None, "min_visibility": None}, []),
    ],
)
def test_points_or_visible_pixels_make_a_box_seen(settings: dict[str, Any], expected: list[int]) -> None:
    points, visibility = [1, 2, 0, 0, -1, -1], [math.nan, 0.0, 0.0, 0.1, 0.5, math.nan]
    boxes = boxes_at(1, 2, 3, 4, 5, 6, lidar_points=points, radar_points=[-1, 1, 0, 0, 0, -1], visibility=visibility)
    spec = scene_with(**settings)
    rows = message_of(agent_view(spec), settings_of(spec), agent_view(spec).ego_row(state_at(0).actors), boxes, 0)
    assert rows["id"][1:].tolist() == expected


@pytest.mark.parametrize(
    ("range_m", "to_ego", "to_car"),
    [
        (50.02, {CAR_ID, RSU_ID}, {EGO_ID, RSU_ID}),
        (50.0, {CAR_ID}, {EGO_ID, RSU_ID}),
        (49.99, set(), {RSU_ID}),
        (44.0, set(), set()),
    ],
)
def test_messages_reach_receivers_up_to_the_range_and_never_the_sender(
    range_m: float, to_ego: set[int], to_car: set[int]
) -> None:
    exchange = play(scene_with(range_m=range_m), 1)[0]  # ego to car: 50 m, to rsu: 50.01 m, car to rsu: 44.73 m
    assert {*exchange.arrived["ego"]["sender"].tolist()} == to_ego
    assert {*exchange.arrived["car"]["sender"].tolist()} == to_car
    assert exchange.sent.keys() == {*AGENTS}


def test_the_range_counts_when_the_message_is_sent() -> None:
    network = network_of(scene_with(latency_s=0.1))
    found = [network.exchange(state_at(tick, gap), {}) for tick, gap in enumerate((90.0, 150.0, 150.0, 90.0, 150.0))]
    assert arrivals(found, "ego", CAR_ID) == [(2, 0)]


@pytest.mark.parametrize(("latency_s", "ticks"), [(0.0, 0), (0.05, 1), (0.051, 2), (0.1, 2), (0.12, 3)])
def test_latency_is_rounded_up_to_whole_ticks(latency_s: float, ticks: int) -> None:
    assert scene_with().tick_ns == TICK_NS
    exchanges = play(scene_with(latency_s=latency_s), 6)
    assert arrivals(exchanges, "car", EGO_ID) == [(tick, tick - ticks) for tick in range(ticks, 6)]


def test_messages_are_sent_at_their_rate_and_nothing_was_sent_before_the_first_tick() -> None:
    exchanges = play(scene_with(rate_hz=5, latency_s=0.15), 9)
    assert [bool(exchange.sent) for exchange in exchanges] == [True, False, False, False] * 2 + [True]
    assert arrivals(exchanges, "ego", CAR_ID) == [(3, 0), (7, 4)]
    assert [len(exchange.arrived["ego"]) for exchange in exchanges] == [0, 0, 0, 3, 0, 0, 0, 3, 0]


def test_what_arrives_is_what_was_sent_in_the_order_of_the_agents_and_of_ticks() -> None:
    exchanges = play(scene_with(latency_s={"uniform": [0, 0.3]}), 60)
    for tick, exchange in enumerate(exchanges):
        rows = exchange.arrived["car"]
        assert (rows["tick"] <= tick).all()
        keys = list(dict.fromkeys((int(sender), int(sent)) for sender, sent in rows[["sender", "tick"]].tolist()))
        assert keys == sorted(keys), "the ego's id is the smallest one, and the roadside unit's the largest one"
        names = {EGO_ID: "ego", RSU_ID: "rsu"}
        sent = [exchanges[sent].sent[names[sender]] for sender, sent in keys]
        assert rows.tobytes() == b"".join(message.tobytes() for message in sent)
    of_ego = arrivals(exchanges, "car", EGO_ID)
    assert {tick - sent for tick, sent in of_ego} == {1, 2, 3, 4, 5, 6}
    assert len({sent for _, sent in of_ego}) == len(of_ego) > 50
    assert any(later < earlier for (_, earlier), (_, later) in pairwise(of_ego)), "some overtake others"


def test_messages_are_lost_independently_with_the_given_probability_and_repeatably() -> None:
    spec = scene_with(loss=0.3, agents=["ego", "car"])

    def lost(ticks: int) -> BoolArray:
        network = network_of(spec)
        found = [network.exchange(state_at(tick), {}).arrived for tick in range(ticks)]
        return np.array([[len(arrived[name]) == 0 for name in ("ego", "car")] for arrived in found])

    first = lost(1500)
    share = first.mean()
    assert abs(share - 0.3) < 4.0 * math.sqrt(0.3 * 0.7 / first.size), "of 3,000 draws"
    assert abs(np.corrcoef(first.T)[0, 1]) < 0.1
    assert abs(np.corrcoef(first[1:, 0], first[:-1, 0])[0, 1]) < 0.1
    np.testing.assert_array_equal(lost(100), first[:100])


def test_who_loses_what_does_not_depend_on_other_agents() -> None:
    alone, together = (play(scene_with(loss=0.5, agents=agents), 40) for agents in (AGENTS[:2], AGENTS))
    assert arrivals(alone, "car", EGO_ID) == arrivals(together, "car", EGO_ID)
    assert 0 < len(arrivals(alone, "car", EGO_ID)) < 40


def test_all_messages_are_lost_with_probability_one() -> None:
    assert all(not len(rows) for exchange in play(scene_with(loss=1.0), 5) for rows in exchange.arrived.values())


def test_agents_that_take_no_part_neither_send_nor_receive() -> None:
    exchange = play(scene_with(agents=["ego", "rsu"]), 1)[0]
    assert exchange.sent.keys() == exchange.arrived.keys() == {"ego", "rsu"}
    assert {*exchange.arrived["ego"]["sender"].tolist()} == {RSU_ID}


def test_an_agent_whose_boxes_are_unknown_sends_its_pose() -> None:
    assert [len(rows) for rows in network_of(scene_with()).exchange(state_at(0), {}).sent.values()] == [1, 1, 1]


def test_messages_of_ticks_that_were_skipped_arrive_at_the_next_one() -> None:
    network = network_of(scene_with(latency_s=0.1))
    network.exchange(state_at(0), {})
    assert network.exchange(state_at(5), {}).arrived["ego"]["tick"].tolist() == [0, 0]


def errors(names: str, ticks: int, **settings: float) -> Float64Array:
    """(ticks, 3, columns) errors in the columns of the messages of the ego."""
    exact, spec, boxes, carrier = scene_with(), scene_with(**settings), boxes_at(7, 9), state_at(0).actors[0]
    columns = names.split()

    def values(tick: int, each: SceneSpec) -> Float64Array:
        rows = message_of(agent_view(each), settings_of(each), carrier, boxes, tick)
        return np.stack([rows[name] for name in columns], axis=-1, dtype=np.float64)

    return np.array([values(tick, spec) for tick in range(ticks)]) - values(0, exact)


def test_an_error_of_the_senders_position_moves_its_boxes_as_well() -> None:
    found = errors("x y", 1000, pose_sigma_m=0.5)
    assert np.ptp(found, axis=1).max() < 1e-9
    assert found[:, 0].std(axis=0) == pytest.approx([0.5, 0.5], rel=0.1)
    assert abs(np.corrcoef(found[:, 0].T)[0, 1]) < 0.15


def test_an_error_of_the_senders_heading_turns_its_boxes_around_it() -> None:
    spec = scene_with(pose_yaw_sigma_deg=4.0)
    view = agent_view(spec)
    rows = message_of(view, settings_of(spec), view.ego_row(state_at(0).actors), boxes_at(7, vx=2.0), 3)
    turn_rad = float(rows["yaw"][0]) - 0.5
    assert 1e-3 < abs(turn_rad) < 0.3
    assert rows[["x", "y"]][0].tolist() == (0, 0)
    assert rows[["x", "y"]][1].tolist() == pytest.approx((70 * math.cos(turn_rad), 70 * math.sin(turn_rad)))
    assert rows["yaw"][1] == pytest.approx(turn_rad, abs=1e-6)
    assert rows[["vx", "vy"]].tolist() == [
        pytest.approx((speed * math.cos(turn_rad), speed * math.sin(turn_rad)), abs=1e-6) for speed in (3.0, 2.0)
    ]


def test_each_box_has_errors_of_its_own_and_the_sender_has_not() -> None:
    found = errors("x y yaw", 999, position_sigma_m=0.2, yaw_sigma_deg=3.0)
    assert not found[:, 0].any()
    for box in (1, 2):
        assert found[:, box].std(axis=0) == pytest.approx([0.2, 0.2, math.radians(3.0)], rel=0.1)
    assert abs(np.corrcoef(found[:, 1, 0], found[:, 2, 0])[0, 1]) < 0.15


def test_errors_differ_between_senders_and_not_between_runs() -> None:
    spec = scene_with(pose_sigma_m=1.0)
    first, second = play(spec, 3), play(spec, 3)
    for before, after in zip(first, second, strict=True):
        assert all(before.sent[name].tobytes() == after.sent[name].tobytes() for name in AGENTS)
    assert len({float(first[0].sent[name]["x"][0]) % 10.0 for name in AGENTS}) == 3
    assert agent_view(spec, "car").noise_seed != agent_view(spec).noise_seed


def test_headings_with_errors_stay_within_half_a_turn() -> None:
    spec = scene_with(yaw_sigma_deg=180.0)
    boxes = boxes_at(*range(1, 200), yaw=3.1)
    rows = message_of(agent_view(spec), settings_of(spec), agent_view(spec).ego_row(state_at(0).actors), boxes, 0)
    assert (np.abs(rows["yaw"]) <= np.float32(math.pi)).all()
    assert np.ptp(rows["yaw"]) > 6.0


def test_as_boxes_senders_have_their_ids_and_their_centers_above_the_ground() -> None:
    found = boxes_of_messages(play(scene_with(), 1)[0].arrived["ego"])
    assert found["id"].tolist() == [CAR_ID, 9]
    expected = (50.0 + 0.75 * math.sin(0.3), 0.0, 0.75 * math.cos(0.3))
    assert found[["x", "y", "z"]][0].tolist() == pytest.approx(expected, abs=1e-6)
    assert found[["x", "y", "z"]][1].tolist() == (90.0, 0.0, 0.0)
