"""Conditions and triggers of a storyboard: true or false at each tick, with edges and delays."""

import math
from collections import deque
from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

import numpy as np

from simbev_ros.maps.opendrive.lane_places import wrapped
from simbev_ros.scene.storyboard.bodies import Body
from simbev_ros.scene.storyboard.model import Element
from simbev_ros.scene.storyboard.parameters import RULES
from simbev_ros.simulation.world.storyboard.measures import closing_mps, gap_m, overlap
from simbev_ros.simulation.world.storyboard.stage import Stage

_SAME = 1e-6


class States(Protocol):
    """What conditions can ask about the elements of a storyboard."""

    def has_state(self, kind: str, reference: str, state: str) -> bool:
        """Whether an element is in a state, or has gone through a transition since the conditions before this tick."""


class Verdict(NamedTuple):
    """Result of a trigger or condition, and the names of the entities that made it true."""

    holds: bool
    entities: tuple[str, ...] = ()


class Trigger:
    """A start or stop trigger: true if all conditions of any of its groups are; without a group never."""

    def __init__(self, element: Element) -> None:
        self._groups = [[_Condition(each) for each in group.conditions] for group in element.groups]

    def reset(self) -> None:
        """Forget earlier ticks, as conditions begin with their element."""
        for group in self._groups:
            for condition in group:
                condition.reset()

    def evaluate(self, stage: Stage, states: States) -> Verdict:
        """Evaluate all conditions, once a tick."""
        results = [[condition.evaluate(stage, states) for condition in group] for group in self._groups]
        for group in results:
            if all(verdict.holds for verdict in group):
                return Verdict(True, tuple(dict.fromkeys(name for verdict in group for name in verdict.entities)))
        return Verdict(False)


class _Condition:
    """One condition with its edge, its delay and what it has seen."""

    def __init__(self, element: Element) -> None:
        self._element = element
        self.reset()

    def reset(self) -> None:
        self._before: bool | None = None
        self._history: deque[tuple[float, Verdict]] = deque()

    def evaluate(self, stage: Stage, states: States) -> Verdict:
        raw = Verdict(False)
        with stage.noted("the condition does not hold"):
            raw = self._raw(stage, states)
        before, self._before = self._before, raw.holds
        rises, falls = before is False and raw.holds, before is True and not raw.holds
        edges = {"none": raw.holds, "rising": rises, "falling": falls, "risingOrFalling": rises or falls}
        verdict = Verdict(edges[self._element.condition_edge], raw.entities)
        if not self._element.delay_s:
            return verdict
        self._history.append((stage.time_s, verdict))
        due_s, delayed = stage.time_s - self._element.delay_s + _SAME, Verdict(False)
        while self._history and self._history[0][0] <= due_s:
            time_s, each = self._history.popleft()
            if time_s > due_s - stage.tick_s:  # a pulse counts at its own tick
                delayed = each
        return delayed

    def _raw(self, stage: Stage, states: States) -> Verdict:
        test, element = self._element.test, self._element
        if test.kind in _ENTITY_TESTS:
            check, who = _ENTITY_TESTS[test.kind], element.triggering_entities
            names = [reference.entity_ref for reference in who.entities]
            bodies = [stage.bodies[name] for name in names]
            if not all(
                stage.bodies[each.entity_ref].is_present
                for each in (test, getattr(test, "target", test))
                if hasattr(each, "entity_ref")
            ):
                return Verdict(False)
            met = tuple(body.name for body in bodies if body.is_present and check(stage, body, test))
            is_met = len(met) == len(names) if who.triggering_entities_rule == "all" else bool(met)
            return Verdict(is_met, met)
        if test.kind == "StoryboardElementStateCondition":
            return Verdict(states.has_state(test.storyboard_element_type, test.storyboard_element_ref, test.state))
        return Verdict(_VALUE_TESTS[test.kind](stage, test))


def holds(rule: str, value: float, reference: float) -> bool:
    """Whether two numbers are as a rule says; numbers that differ by rounding are equal."""
    if abs(value - reference) <= _SAME * max(1.0, abs(reference)):
        value = reference
    return RULES[rule](value, reference)


def _end_of_road(stage: Stage, body: Body, test: Element) -> bool:
    return body.end_of_road_s > 0.0 and body.end_of_road_s >= test.duration_s - _SAME


def _collision(stage: Stage, body: Body, test: Element) -> bool:
    named = {target.entity_ref for target in test.targets if target.kind == "EntityRef"}
    kinds = {target.type for target in test.targets if target.kind == "ByType"}
    others = [each for each in stage.bodies.values() if each is not body and (each.name in named or each.kind in kinds)]
    return any(other.is_present and overlap(body, other) for other in others)


def _offroad(stage: Stage, body: Body, test: Element) -> bool:
    return body.off_road_s > 0.0 and body.off_road_s >= test.duration_s - _SAME


def _headway(stage: Stage, body: Body, test: Element) -> bool:
    speed_mps, gap = abs(body.speed_mps), gap_m(stage, body, stage.bodies[test.entity_ref], test)
    return holds(test.rule, gap / speed_mps if speed_mps > _SAME else math.inf, test.value_s)


def _time_to_collision(stage: Stage, body: Body, test: Element) -> bool:
    target = test.target
    other = stage.bodies[target.entity_ref] if target.kind == "EntityRef" else stage.positions.pose(target)
    speed_mps = closing_mps(stage, body, other, test)
    time_s = gap_m(stage, body, other, test) / speed_mps if speed_mps > _SAME else math.inf
    return holds(test.rule, time_s, test.value_s)


def _component(body: Body, direction: str | None, longitudinal: float, lateral: float) -> float:
    return {"lateral": lateral, "vertical": 0.0}.get(direction or "", longitudinal)


def _acceleration(stage: Stage, body: Body, test: Element) -> bool:
    return holds(test.rule, _component(body, test.direction, body.acceleration_mps2, 0.0), test.value_mps2)


def _stand_still(stage: Stage, body: Body, test: Element) -> bool:
    return body.standing_s is not None and body.standing_s >= test.duration_s - _SAME


def _speed_of(body: Body, direction: str | None) -> float:
    return _component(body, direction, body.speed_mps, body.lateral_mps)


def _speed(stage: Stage, body: Body, test: Element) -> bool:
    return holds(test.rule, _speed_of(body, test.direction), test.value_mps)


def _relative_speed(stage: Stage, body: Body, test: Element) -> bool:
    other = stage.bodies[test.entity_ref]
    return holds(test.rule, _speed_of(body, test.direction) - _speed_of(other, test.direction), test.value_mps)


def _travelled(stage: Stage, body: Body, test: Element) -> bool:
    return body.travelled_m >= test.value_m - _SAME


def _reach(stage: Stage, body: Body, test: Element) -> bool:
    arm_m = np.asarray(stage.positions.pose(test.position).position_m - body.position_m)[:2]
    return float(np.hypot(*arm_m)) <= test.tolerance_m


def _distance(stage: Stage, body: Body, test: Element) -> bool:
    return holds(test.rule, gap_m(stage, body, stage.positions.pose(test.position), test), test.value_m)


def _relative_distance(stage: Stage, body: Body, test: Element) -> bool:
    return holds(test.rule, gap_m(stage, body, stage.bodies[test.entity_ref], test), test.value_m)


def _clearance(stage: Stage, body: Body, test: Element) -> bool:
    """Whether no other entity is in the given lanes around one."""
    roads, here = stage.mover.roads, stage.mover.lane_at(body.position_m, body.yaw_rad)
    if here is None:
        return True
    named = {reference.entity_ref for reference in test.entities}
    for other in stage.bodies.values():
        there = stage.mover.lane_at(other.position_m, other.yaw_rad)
        if other is body or not other.is_present or there is None or (named and other.name not in named):
            continue
        along_m = roads.distance_m(here, roads.point_of(there))
        if along_m is None or (not test.opposite_lanes and there.lane * here.lane < 0):
            continue
        free_m = (body.size_m[0] + other.size_m[0]) / 2.0 if test.free_space else 0.0
        if -test.distance_backward_m - free_m <= along_m <= test.distance_forward_m + free_m:
            left = (there.lane - here.lane) * (1 if here.forward else -1)
            left -= int(math.copysign(1, left)) if there.lane * here.lane < 0 else 0
            bounds = [(each.from_lane, each.to_lane) for each in test.lanes] or [(None, None)]
            if any((low is None or left >= low) and (high is None or left <= high) for low, high in bounds):
                return False
    return True


def _angle(stage: Stage, body: Body, test: Element) -> bool:
    place = stage.mover.lane_at(body.position_m, body.yaw_rad) if test.coordinate_system != "world" else None
    base_rad = 0.0 if place is None else stage.mover.direction_rad(place)
    angles = {"heading": body.yaw_rad - base_rad, "pitch": body.pitch_rad, "roll": body.roll_rad}
    return abs(wrapped(angles[test.angle_type] - test.angle_rad)) <= test.angle_tolerance_rad


def _relative_angle(stage: Stage, body: Body, test: Element) -> bool:
    other = stage.bodies[test.entity_ref]
    name = {"heading": "yaw_rad"}.get(test.angle_type, f"{test.angle_type}_rad")
    angle_rad = getattr(other, name) - getattr(body, name)
    return abs(wrapped(angle_rad - test.angle_rad)) <= test.angle_tolerance_rad


_ENTITY_TESTS: Mapping[str, Callable[[Stage, Body, Element], bool]] = {
    "EndOfRoadCondition": _end_of_road,
    "CollisionCondition": _collision,
    "OffroadCondition": _offroad,
    "TimeHeadwayCondition": _headway,
    "TimeToCollisionCondition": _time_to_collision,
    "AccelerationCondition": _acceleration,
    "StandStillCondition": _stand_still,
    "SpeedCondition": _speed,
    "RelativeSpeedCondition": _relative_speed,
    "TraveledDistanceCondition": _travelled,
    "ReachPositionCondition": _reach,
    "DistanceCondition": _distance,
    "RelativeDistanceCondition": _relative_distance,
    "RelativeClearanceCondition": _clearance,
    "AngleCondition": _angle,
    "RelativeAngleCondition": _relative_angle,
}


def _value(stage: Stage, test: Element) -> bool:
    name = test.parameter_ref if test.kind == "ParameterCondition" else test.variable_ref
    value, reference = stage.values[name], test.value
    try:
        return holds(test.rule, float(value), float(reference))
    except ValueError:
        return RULES[test.rule](value, reference)


def _time_of_day(stage: Stage, test: Element) -> bool:
    now = stage.date_time
    return now is not None and RULES[test.rule](now.replace(tzinfo=None), test.date_time.replace(tzinfo=None))


_VALUE_TESTS: Mapping[str, Callable[[Stage, Element], bool]] = {
    "ParameterCondition": _value,
    "VariableCondition": _value,
    "TimeOfDayCondition": _time_of_day,
    "SimulationTimeCondition": lambda stage, test: holds(test.rule, stage.time_s, test.value_s),
    "UserDefinedValueCondition": lambda stage, test: False,
    "TrafficSignalCondition": lambda stage, test: stage.signals.states.get(test.name) == test.state,
    "TrafficSignalControllerCondition": lambda stage, test: (
        stage.signals.phases.get(test.traffic_signal_controller_ref) == test.phase
    ),
}
