"""Each condition of a storyboard: the first tick at which it is true, by hand; edges, delays and groups as tables."""

import datetime
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from storyboard_stage import (
    Y_RIGHT,
    Show,
    after,
    car,
    event,
    lane,
    person,
    placed,
    speed,
    story,
    storyboard,
    straight,
    trigger,
    world,
)

from simbev_ros.scene.storyboard import model
from simbev_ros.scene.storyboard.model import Element

First = Callable[..., float | None]


@pytest.fixture
def first(tmp_path: Path) -> First:
    """Time at which a condition of the ego is true for the first time; the ego drives 10 m/s from s = 100 m.

    Another car drives 5 m/s from 150 m in the same lane; a person stands at (200, 3.25); until 20 s.
    """

    def find(
        test: Element,
        *events: Element,
        who: Sequence[str] = ("ego",),
        first_actions: Sequence[Element] = (),
        until_s: float = 20.0,
    ) -> float | None:
        board = storyboard(
            placed("ego", lane(100.0), 10.0),
            placed("other", lane(150.0), 5.0),
            placed("person", world(200.0, 3.25, math.pi / 2.0)),
            story(["ego"], event("probe", trigger(test, who=who), model.AssignControllerAction(), priority="parallel"),
                  *events),
            first=first_actions,
        )  # fmt: skip
        bodies = [car("ego"), car("other"), person("person")]
        show = Show(straight(tmp_path, 300.0), bodies, board, {"p": "3", "text": "abc"})
        show.run_to(until_s)
        return next(iter(show.times("start", "probe")), None)

    return find


def at(value: float) -> object:
    return pytest.approx(value, abs=1e-6)


def relative(kind: str, value_m: float, *, free: bool, system: str = "entity", rule: str = "lessOrEqual") -> Element:
    return model.RelativeDistanceCondition(
        entity_ref="other", value_m=value_m, freespace=free, rule=rule, relative_distance_type=kind,
        coordinate_system=system,
    )  # fmt: skip


@pytest.mark.parametrize("system", ["entity", "lane", "road", "world"])
def test_longitudinal_distance(first: First, system: str) -> None:
    assert first(relative("longitudinal", 20.0, free=False, system=system)) == at(6.0)  # 50 - 5 t = 20
    assert first(relative("longitudinal", 20.0, free=True, system=system)) == at(5.2)  # 46 - 5 t = 20


def test_straight_distance(first: First) -> None:
    assert first(relative("euclidianDistance", 20.0, free=False)) == at(6.0)
    assert first(relative("euclidianDistance", 20.0, free=True)) == at(5.2)


def test_lateral_distance(first: First) -> None:
    test = model.RelativeDistanceCondition(
        entity_ref="person", value_m=3.75, freespace=True, rule="lessOrEqual", relative_distance_type="lateral"
    )
    assert first(test) == at(0.0)  # 5 m minus 1 m and 0.25 m, the half length of the person, who looks across
    longer = model.RelativeDistanceCondition(
        entity_ref="person", value_m=3.74, freespace=True, rule="lessOrEqual", relative_distance_type="lateral"
    )
    assert first(longer) is None


def test_distance_to_a_position(first: First) -> None:
    test = model.DistanceCondition(
        value_m=5.0, freespace=True, rule="lessThan", position=lane(200.0), relative_distance_type="longitudinal"
    )
    # The front of the box is 3.4 m ahead of the reference point: 96.6 - 10 t < 5.
    assert first(test) == at(9.2)


def test_reached_position(first: First) -> None:
    assert first(model.ReachPositionCondition(tolerance_m=5.0, position=world(200.0, Y_RIGHT - 3.0))) == at(9.6)


def test_time_to_collision(first: First) -> None:
    fields = {"freespace": True, "rule": "lessThan", "relative_distance_type": "longitudinal"}
    test = model.TimeToCollisionCondition(value_s=2.0, target=model.EntityRef(entity_ref="other"), **fields)
    assert first(test) == at(7.25)  # (46 - 5 t) / 5 < 2
    test = model.TimeToCollisionCondition(value_s=2.0, target=world(250.0, Y_RIGHT), **fields)
    assert first(test) == at(12.7)  # (146.6 - 10 t) / 10 < 2


def test_time_to_collision_is_infinite_while_they_part(first: First) -> None:
    test = model.TimeToCollisionCondition(
        value_s=1e6, freespace=False, rule="lessThan", target=model.EntityRef(entity_ref="ego")
    )
    assert first(test, who=["other"]) == at(0.0)  # the ego closes in from behind
    behind = model.TimeToCollisionCondition(value_s=1e6, freespace=False, rule="lessThan", target=world(0.0, Y_RIGHT))
    assert first(behind) is None


def test_time_headway(first: First) -> None:
    test = model.TimeHeadwayCondition(entity_ref="other", value_s=3.0, freespace=False, rule="lessOrEqual")
    assert first(test) == at(4.0)  # (50 - 5 t) / 10 = 3


def test_speeds_and_acceleration(first: First) -> None:
    brake = event("brake", after(2.0), speed(0.0, "linear", "rate", 4.0), priority="parallel")
    assert first(model.SpeedCondition(value_mps=6.0, rule="lessOrEqual"), brake) == at(3.0)
    relative_speed = model.RelativeSpeedCondition(entity_ref="other", value_mps=0.0, rule="lessThan")
    assert first(relative_speed, brake) == at(3.3)  # 10 - 4 (t - 2) < 5
    assert first(model.AccelerationCondition(value_mps2=-3.9, rule="lessThan"), brake) == at(2.05)
    assert first(model.StandStillCondition(duration_s=1.0), brake) == at(5.5)  # rests from 4.5 s on
    assert first(model.TraveledDistanceCondition(value_m=22.0), brake) == at(2.25)  # 20 + 10 x - 2 x² >= 22
    assert first(model.SpeedCondition(value_mps=0.0, rule="equalTo", direction="lateral")) == at(0.0)


def test_collision_by_name_and_by_type(first: First) -> None:
    by_name = model.CollisionCondition(targets=(model.EntityRef(entity_ref="other"),))
    assert first(by_name) == at(9.2)  # 46 - 5 t = 0
    assert first(model.CollisionCondition(targets=(model.ByType(type="pedestrian"),))) is None
    assert first(model.CollisionCondition(targets=(model.ByType(type="vehicle"),))) == at(9.2)


def test_end_of_road_and_off_road(first: First) -> None:  # the road ends at 300 m
    assert first(model.EndOfRoadCondition(duration_s=0.0), until_s=25.0) == at(20.05)
    assert first(model.OffroadCondition(duration_s=1.0), until_s=25.0) == pytest.approx(21.2, abs=0.06)  # 2 m later


def test_clearance(first: First) -> None:
    lanes = (model.RelativeLaneRange(from_lane=-1, to_lane=0),)
    fields = {"opposite_lanes": False, "lanes": lanes, "entities": ()}
    fields |= {"distance_backward_m": 1000.0}
    assert first(model.RelativeClearanceCondition(distance_forward_m=50.0, free_space=False, **fields)) is None
    assert first(model.RelativeClearanceCondition(distance_forward_m=49.0, free_space=False, **fields)) == at(0.0)
    assert first(model.RelativeClearanceCondition(distance_forward_m=49.0, free_space=True, **fields)) is None


def test_angles(first: First) -> None:
    fields = {"angle_type": "heading", "angle_tolerance_rad": 0.01}
    assert first(model.AngleCondition(angle_rad=0.0, coordinate_system="lane", **fields)) == at(0.0)
    assert first(model.AngleCondition(angle_rad=1.0, coordinate_system="lane", **fields)) is None
    assert first(model.RelativeAngleCondition(entity_ref="person", angle_rad=math.pi / 2.0, **fields)) == at(0.0)


def test_values(first: First) -> None:
    change = model.VariableAction(variable_ref="p", change=model.SetAction(value="4.5"))
    set_later = event("set", after(1.0), change, priority="parallel")
    assert first(model.VariableCondition(variable_ref="p", value="4", rule="greaterThan"), set_later, who=()) == at(
        1.05
    )
    assert first(model.ParameterCondition(parameter_ref="text", value="abc", rule="equalTo"), who=()) == at(0.0)
    assert first(model.UserDefinedValueCondition(name="x", value="1", rule="equalTo"), who=()) is None


def test_date_and_time(first: First) -> None:
    noon = datetime.datetime(2026, 6, 21, 12, tzinfo=datetime.UTC)
    clock = model.EnvironmentAction(
        environment=model.Environment(name="e", time_of_day=model.TimeOfDay(animation=True, date_time=noon))
    )
    later = model.TimeOfDayCondition(date_time=noon + datetime.timedelta(seconds=3), rule="greaterOrEqual")
    assert first(later, who=(), first_actions=[clock]) == at(3.0)


def test_signals(first: First) -> None:
    green = model.TrafficSignalStateAction(name="7", state="green")
    change = event("change", after(2.0), green, priority="parallel")
    assert first(model.TrafficSignalCondition(name="7", state="green"), change, who=()) == at(2.05)


EDGES = {
    # A condition that is true from 1.00 to 1.95 s; it is evaluated from 0 s on.
    ("none", 0.0): 1.0,
    ("rising", 0.0): 1.0,
    ("falling", 0.0): 2.0,
    ("risingOrFalling", 0.0): 1.0,
    ("none", 0.5): 1.5,
    ("rising", 0.5): 1.5,
    ("falling", 0.5): 2.5,
    ("falling", 0.07): 2.1,
}


@pytest.mark.parametrize(("edge", "delay_s"), EDGES)
def test_edges_and_delays(tmp_path: Path, edge: str, delay_s: float) -> None:
    pulse = model.VariableCondition(variable_ref="p", value="1", rule="equalTo")
    events = [
        event(f"set{k}", after(time_s), model.VariableAction(variable_ref="p", change=model.SetAction(value=value)),
              priority="parallel")
        for k, (time_s, value) in enumerate([(1.0, "1"), (2.0, "0")])
    ]  # fmt: skip
    probe = event(
        "probe", trigger(pulse, edge=edge, delay_s=delay_s), model.AssignControllerAction(), priority="parallel"
    )
    board = storyboard(placed("ego", lane(0.0)), story(["ego"], *events, probe))
    show = Show(straight(tmp_path), [car("ego")], board, {"p": "0"})
    show.run_to(5.0)
    assert show.times("start", "probe") == [pytest.approx(EDGES[edge, delay_s])]


def test_an_edge_needs_a_tick_before_it(tmp_path: Path) -> None:
    always = model.SimulationTimeCondition(value_s=0.0, rule="greaterOrEqual")
    probe = event("probe", trigger(always, edge="rising"), model.AssignControllerAction())
    show = Show(straight(tmp_path), [car("ego")], storyboard(placed("ego", lane(0.0)), story(["ego"], probe)))
    show.run_to(2.0)
    assert show.times("start", "probe") == []


@pytest.mark.parametrize(("rule", "expected"), [("any", 4.0), ("all", 8.0)])
def test_any_or_all_triggering_entities(tmp_path: Path, rule: str, expected: float) -> None:
    far = trigger(model.TraveledDistanceCondition(value_m=40.0), who=["ego", "other"], rule=rule)
    board = storyboard(
        placed("ego", lane(0.0), 10.0), placed("other", lane(50.0), 5.0), story(["ego"], event("e", far, speed(0.0)))
    )
    show = Show(straight(tmp_path), [car("ego"), car("other")], board)
    show.run_to(9.0)
    assert show.times("start", "e") == [pytest.approx(expected)]


def test_the_triggering_entities_act(tmp_path: Path) -> None:
    far = trigger(model.TraveledDistanceCondition(value_m=40.0), who=["ego", "other"])
    board = storyboard(
        placed("ego", lane(0.0), 10.0),
        placed("other", lane(50.0), 5.0),
        story([], event("e", far, speed(0.0)), triggering=True),
    )
    show = Show(straight(tmp_path), [car("ego"), car("other")], board)
    show.run_to(5.0)
    assert (show["ego"].speed_mps, show["other"].speed_mps) == (0.0, 5.0)


def test_all_conditions_of_a_group_and_any_group(tmp_path: Path) -> None:
    def times(*bounds: float) -> Element:
        return model.ConditionGroup(
            conditions=tuple(
                model.Condition(name="c", test=model.SimulationTimeCondition(value_s=bound, rule="greaterOrEqual"))
                for bound in bounds
            )
        )

    start = model.Trigger(groups=(times(1.0, 3.0), times(2.0)))
    board = storyboard(placed("ego", lane(0.0)), story(["ego"], event("e", start, speed(0.0))))
    show = Show(straight(tmp_path), [car("ego")], board)
    show.run_to(4.0)
    assert show.times("start", "e") == [2.0]
