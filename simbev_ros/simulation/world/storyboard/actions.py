"""Actions that move an entity: an element in, a motion that lasts until its goal out."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

from simbev_ros.scene.storyboard.bodies import Body
from simbev_ros.scene.storyboard.model import Element
from simbev_ros.simulation.world.storyboard.motions import (
    AcquirePosition,
    FollowTrajectory,
    KeepDistance,
    KeepLateral,
    Shift,
    SpeedChange,
    SpeedLikeAnother,
    Synchronize,
    shape_of,
    side_of,
    target_mps,
)
from simbev_ros.simulation.world.storyboard.profiles import Transition, speed_transition, transition
from simbev_ros.simulation.world.storyboard.stage import Motion, Stage


def _speed(stage: Stage, body: Body, element: Element) -> Motion | None:
    dynamics, target = element.dynamics, element.target
    if getattr(target, "continuous", False):
        motion: Motion = SpeedLikeAnother(target, dynamics, body.speed_mps)
    else:
        end_mps = target_mps(stage, target)
        change = speed_transition(body.speed_mps, end_mps, *shape_of(dynamics))
        motion = SpeedChange(change)
        if change.length <= 0.0:
            body.speed_mps, motion.done = end_mps, True
    stage.take_over(stage.longitudinal, body, motion)
    return motion


def _speed_profile(stage: Stage, body: Body, element: Element) -> Motion | None:
    base_mps = stage.bodies[element.entity_ref].speed_mps if element.entity_ref else 0.0
    limits, changes, speed_mps = element.dynamic_constraints, list[Transition](), body.speed_mps
    for entry in element.entries:
        end_mps = base_mps + entry.speed_mps
        length_s = entry.time_s
        if length_s is None:
            name = "max_acceleration_mps2" if end_mps > speed_mps else "max_deceleration_mps2"
            limit = getattr(limits, name, None) or math.inf
            length_s = abs(end_mps - speed_mps) / limit
        changes.append(Transition(speed_mps, end_mps, length_s))
        speed_mps = end_mps
    motion = SpeedChange(*changes)
    stage.take_over(stage.longitudinal, body, motion)
    return motion


def _lane_change(stage: Stage, body: Body, element: Element) -> Motion | None:
    if body.place is None:
        return _refused(stage, body, element)
    roads, place, target = stage.mover.roads, body.place, element.target
    if target.kind == "AbsoluteTargetLane":
        lane = target.value
    else:
        other = stage.bodies[target.entity_ref]
        reference = stage.mover.lane_at(other.position_m, other.yaw_rad) or place
        lane = roads.next_lane(reference, target.value)
        if reference.forward != place.forward and reference.road != place.road:
            lane = -lane  # of this road, whose s runs the other way
    try:
        moved_m = roads.point_of(place).t_m - roads.lane_t_m(place.road, lane, place.s_m)
    except KeyError as error:
        return _refused(stage, body, element, error.args[0])
    body.place = replace(place, lane=lane, offset_m=moved_m)
    end_m = element.target_lane_offset_m * side_of(place)
    return _shift(stage, body, element.dynamics, moved_m * side_of(place), end_m)


def _shift(stage: Stage, body: Body, dynamics: Element, start_m: float, end_m: float) -> Motion:
    dimension = dynamics.dynamics_dimension
    profile = transition(start_m, end_m, dynamics.dynamics_shape, dimension, dynamics.value)
    return _shifted(stage, body, Shift(profile, over_time=dimension != "distance", keeps_speed=True), profile)


def _shifted(stage: Stage, body: Body, motion: Shift, profile: Transition, *, ends: bool = True) -> Motion:
    stage.take_over(stage.lateral, body, motion)
    if profile.length <= 0.0 and body.place is not None:
        body.place = replace(body.place, offset_m=profile.end * side_of(body.place))
        stage.mover.pose_on_lane(body)
        motion.done = ends
    return motion


def _lane_offset(stage: Stage, body: Body, element: Element) -> Motion | None:
    if body.place is None:
        return _refused(stage, body, element)
    side, target = side_of(body.place), element.target
    end_m = target.value_m * side
    if target.kind == "RelativeTargetLaneOffset":
        other = stage.bodies[target.entity_ref]
        reference = stage.mover.lane_at(other.position_m, other.yaw_rad)
        end_m += 0.0 if reference is None else reference.offset_m * side
    start_m, limit = body.place.offset_m * side, element.dynamics.max_lateral_acc_mps2
    shape, moved_m = element.dynamics.dynamics_shape, abs(end_m - start_m)
    # The largest second derivative of a cubic is 6 d / T², of a sinusoid π² d / (2 T²).
    factor = math.pi**2 / 2.0 if shape == "sinusoidal" else 6.0
    length_s = 0.0 if shape == "step" or not limit else math.sqrt(factor * moved_m / limit)
    profile = Transition(start_m, end_m, length_s, "linear" if shape == "step" else shape)
    ends = not element.continuous
    return _shifted(stage, body, Shift(profile, ends=ends), profile, ends=ends)


def _follow_trajectory(stage: Stage, body: Body, element: Element) -> Motion | None:
    motion = FollowTrajectory(element, stage)
    motion.place(stage, body)
    stage.take_over(stage.lateral, body, motion)
    if motion.timing is not None:
        stage.take_over(stage.longitudinal, body, motion)
    return motion


def _longitudinal(make: Callable[[Element], Motion]) -> "Start":
    def begin(stage: Stage, body: Body, element: Element) -> Motion | None:
        motion = make(element)
        stage.take_over(stage.longitudinal, body, motion)
        return motion

    return begin


def _keep_lateral(stage: Stage, body: Body, element: Element) -> Motion | None:
    if body.place is None:
        return _refused(stage, body, element)
    motion = KeepLateral(element)
    stage.take_over(stage.lateral, body, motion)
    return motion


def _teleport(stage: Stage, body: Body, element: Element) -> Motion | None:
    stage.mover.put(body, stage.positions.pose(element.position))
    return None


def _assign_route(stage: Stage, body: Body, element: Element) -> Motion | None:
    body.route = stage.positions.route(element.route, body.place)
    return None


def _acquire_position(stage: Stage, body: Body, element: Element) -> Motion | None:
    goal = stage.positions.pose(element.position)
    place = goal.place or stage.mover.lane_at(goal.position_m, goal.yaw_rad)
    if body.place is not None and place is not None:
        roads = stage.mover.roads.route_between(body.place, stage.mover.roads.point_of(place))
        body.route = roads or body.route
    else:
        arm_m = (goal.position_m - body.position_m)[:2]
        body.place, body.yaw_rad = None, math.atan2(arm_m[1], arm_m[0])
    motion = AcquirePosition(goal)
    stage.take_over(stage.lateral, body, motion)
    return motion


def _refused(stage: Stage, body: Body, element: Element, reason: str = "it is on no lane") -> Motion | None:
    stage.notes[f"{element.origin}: {element.kind} of {body.name} has no effect: {reason}"] = None
    return None


Start = Callable[[Stage, Body, Element], Motion | None]
"""Starts an action of an entity; None: it is done."""

MOTIONS: Mapping[str, Start] = {
    "TeleportAction": _teleport,
    "SpeedAction": _speed,
    "SpeedProfileAction": _speed_profile,
    "LongitudinalDistanceAction": _longitudinal(KeepDistance),
    "SynchronizeAction": _longitudinal(Synchronize),
    "LaneChangeAction": _lane_change,
    "LaneOffsetAction": _lane_offset,
    "LateralDistanceAction": _keep_lateral,
    "FollowTrajectoryAction": _follow_trajectory,
    "AssignRouteAction": _assign_route,
    "AcquirePositionAction": _acquire_position,
}
"""The actions that move an entity."""
