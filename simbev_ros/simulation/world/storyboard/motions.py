"""Motions of entities that last: speed, distance, lanes, trajectories, synchronization."""

import math
from dataclasses import replace

import numpy as np

from simbev_ros.maps.opendrive.lane_places import LanePlace
from simbev_ros.scene.storyboard.bodies import Body, Pose
from simbev_ros.scene.storyboard.model import Element
from simbev_ros.scene.storyboard.trajectories import curve_of
from simbev_ros.simulation.world.storyboard.profiles import Transition, speed_transition
from simbev_ros.simulation.world.storyboard.stage import Stage

_REACHED_M, _SAME_MPS = 1e-3, 1e-3


def side_of(place: LanePlace) -> float:
    """1 if the left of something that moves along its lane is in direction of t, else -1."""
    return 1.0 if place.forward else -1.0


class Moving:
    """Base of motions: without effect, and done at once."""

    def __init__(self) -> None:
        self.done = False

    def distance_m(self, stage: Stage, body: Body) -> float:
        """As in ``Motion``."""
        return body.speed_mps * stage.tick_s

    def steer(self, stage: Stage, body: Body, distance_m: float) -> None:
        """As in ``Motion``."""
        body.lateral_mps = 0.0
        stage.mover.drive(body, distance_m)


class SpeedChange(Moving):
    """A speed that goes through transitions, one after the other, exactly."""

    def __init__(self, *changes: Transition) -> None:
        super().__init__()
        self._changes, self._at_s = [*changes], 0.0

    def distance_m(self, stage: Stage, body: Body) -> float:
        """As in ``Motion``."""
        distance_m, left_s = 0.0, stage.tick_s
        while True:
            change = self._changes[0]
            is_last = len(self._changes) == 1
            part_s = left_s if is_last else min(left_s, change.length - self._at_s)
            distance_m += change.integral(self._at_s + part_s) - change.integral(self._at_s)
            self._at_s, left_s = self._at_s + part_s, left_s - part_s
            if is_last or self._at_s < change.length - 1e-12:
                break
            self._changes.pop(0)
            self._at_s = 0.0
        body.speed_mps = self._changes[0].value(self._at_s + 1e-9)
        self.done = len(self._changes) == 1 and self._at_s >= self._changes[0].length - 1e-9
        return distance_m


class SpeedLikeAnother(Moving):
    """A speed relative to another entity's, for good; the end of the transition to it moves with that."""

    def __init__(self, target: Element, dynamics: Element, start_mps: float) -> None:
        super().__init__()
        self._target, self._dynamics, self._start_mps = target, dynamics, start_mps
        self._at_s, self._is_reached = 0.0, False

    def distance_m(self, stage: Stage, body: Body) -> float:
        """As in ``Motion``."""
        before_mps, body.speed_mps = body.speed_mps, target_mps(stage, self._target)
        if not self._is_reached:
            self._at_s += stage.tick_s
            change = speed_transition(self._start_mps, body.speed_mps, *shape_of(self._dynamics))
            self._is_reached = self._at_s >= change.length - 1e-9
            body.speed_mps = change.value(self._at_s + 1e-9)
        return (before_mps + body.speed_mps) / 2.0 * stage.tick_s


class KeepDistance(Moving):
    """A distance or a time gap to another entity, within limits of speed and acceleration."""

    def __init__(self, element: Element) -> None:
        super().__init__()
        self._element = element

    def distance_m(self, stage: Stage, body: Body) -> float:
        """As in ``Motion``."""
        element, other, tick_s = self._element, stage.bodies[self._element.entity_ref], stage.tick_s
        ahead_m = stage.gap_m(body, other)
        behind = element.displacement == "leadingReferencedEntity" or (element.displacement == "any" and ahead_m < 0.0)
        sign = -1.0 if behind else 1.0
        want_m = element.distance_m if element.distance_m is not None else element.time_gap_s * abs(body.speed_mps)
        if element.freespace:
            want_m += (body.size_m[0] + other.size_m[0]) / 2.0 + sign * (body.center_m[0] - other.center_m[0])
        # The other one may have moved already at this tick.
        moved_m = 0.0 if self._has_moved(stage, body, other) else other.speed_mps * tick_s
        error_m = ahead_m + moved_m - sign * want_m  # to drive in this tick
        limits = element.dynamic_constraints
        speed_mps = error_m / tick_s if limits is None else _limited_mps(body, other, error_m, limits, tick_s)
        step_m = error_m if limits is None else (body.speed_mps + speed_mps) / 2.0 * tick_s
        if limits is None:
            speed_mps = other.speed_mps
        body.speed_mps = speed_mps
        reached = abs(error_m - step_m) < 0.01 and abs(body.speed_mps - other.speed_mps) < 0.05
        if reached:
            body.speed_mps = other.speed_mps
            self.done = self.done or not element.continuous
        return step_m

    @staticmethod
    def _has_moved(stage: Stage, body: Body, other: Body) -> bool:
        names = [*stage.bodies]
        return other.name in stage.outside or names.index(other.name) < names.index(body.name)


def shape_of(dynamics: Element) -> tuple[str, str, float]:
    """Shape, dimension and value of an element ``TransitionDynamics``."""
    return dynamics.dynamics_shape, dynamics.dynamics_dimension, dynamics.value


def _limited_mps(body: Body, other: Body, error_m: float, limits: Element, tick_s: float) -> float:
    """The speed after a tick that closes a distance as fast as limits allow, without passing the goal."""
    speed_up = limits.max_acceleration_mps2 or math.inf
    slow_down = limits.max_deceleration_mps2 or math.inf
    brake = slow_down if error_m > 0.0 else speed_up
    # From this relative speed, constant braking ends at the goal; the tick itself is already driven.
    reach_m = abs(error_m - other.speed_mps * tick_s)
    closing_mps = reach_m / tick_s
    if math.isfinite(brake):
        closing_mps = min(
            closing_mps, math.sqrt(2.0 * brake * reach_m + (brake * tick_s / 2.0) ** 2) - brake * tick_s / 2
        )
    wanted_mps = other.speed_mps + math.copysign(closing_mps, error_m - other.speed_mps * tick_s)
    low, high = body.speed_mps - slow_down * tick_s, body.speed_mps + speed_up * tick_s
    top_mps = min(limits.max_speed_mps or math.inf, body.max_speed_mps)
    return min(max(wanted_mps, low, 0.0), high, top_mps)


class Synchronize(Moving):
    """Reach a position when another entity reaches its own, at a final speed if there is one.

    Distance over time is the straight line to the goal, or with a final speed the cubic through both positions and
    speeds. It is computed again at each tick, so it follows the other entity.
    """

    def __init__(self, element: Element) -> None:
        super().__init__()
        self._element = element

    def distance_m(self, stage: Stage, body: Body) -> float:
        """As in ``Motion``."""
        element, master, tick_s = self._element, stage.bodies[self._element.master_entity_ref], stage.tick_s
        goals = list[Pose]()
        with stage.noted("the action ends"):
            goals = [stage.positions.pose(each) for each in (element.target_position, element.target_position_master)]
        if not goals:
            self.done = True
            return super().distance_m(stage, body)
        left_m, master_m = _remaining_m(stage, body, goals[0]), _remaining_m(stage, master, goals[1])
        speed_mps = max(abs(master.speed_mps), 1e-6)
        if [*stage.bodies].index(master.name) < [*stage.bodies].index(body.name) and master.name not in stage.outside:
            master_m += master.speed_mps * tick_s  # where it was before this tick
        left_s = master_m / speed_mps
        if left_m <= (element.target_tolerance_m or _REACHED_M) or left_s <= 1e-9:
            self.done = True
            return super().distance_m(stage, body)
        final_mps = _final_mps(element.final_speed, master)
        if final_mps is not None:
            left_m, left_s = _before_steady(element.final_speed, final_mps, left_m, left_s)
        if left_s <= tick_s or left_m <= 0.0:
            self.done = left_s <= tick_s
            body.speed_mps = left_m / max(left_s, 1e-9) if final_mps is None else final_mps
            return left_m + body.speed_mps * (tick_s - left_s) if left_s > 0.0 else body.speed_mps * tick_s
        if final_mps is None:
            body.speed_mps = left_m / left_s
            return body.speed_mps * tick_s
        # s(t) = v t + b t² + c t³ with s(T) = d and s'(T) = w.
        start_mps = body.speed_mps
        b = (3.0 * left_m / left_s - 2.0 * start_mps - final_mps) / left_s
        c = (start_mps + final_mps - 2.0 * left_m / left_s) / left_s**2
        body.speed_mps = max(start_mps + 2.0 * b * tick_s + 3.0 * c * tick_s**2, 0.0)
        return max(start_mps * tick_s + b * tick_s**2 + c * tick_s**3, 0.0)


def _final_mps(final: Element | None, master: Body) -> float | None:
    if final is None:
        return None
    if final.kind == "AbsoluteSpeed":
        return float(final.value_mps)
    is_factor = final.speed_target_value_type == "factor"
    return float(master.speed_mps * final.value if is_factor else master.speed_mps + final.value)


def _before_steady(final: Element, final_mps: float, left_m: float, left_s: float) -> tuple[float, float]:
    """Distance and time up to where the final speed must be reached."""
    steady = final.steady_state
    if steady is None or final_mps <= 0.0:
        return left_m, left_s
    steady_m = steady.distance_m if steady.kind == "TargetDistanceSteadyState" else steady.time_s * final_mps
    return left_m - steady_m, left_s - steady_m / final_mps


def _remaining_m(stage: Stage, body: Body, goal: Pose) -> float:
    """Distance of an entity to a position: on its trajectory, along its lanes, or straight; negative behind it."""
    steering = stage.lateral.get(body.name)
    if isinstance(steering, FollowTrajectory):
        return steering.remaining_m(goal)
    if body.place is not None:
        place = goal.place or stage.mover.lane_at(goal.position_m, body.yaw_rad)
        if place is not None:
            along_m = stage.mover.roads.distance_m(body.place, stage.mover.roads.point_of(place))
            if along_m is not None:
                return along_m
    return float(body.axes[0] @ (goal.position_m - body.position_m)[:2])


class Shift(Moving):
    """A lateral transition on the lane, over time or over the distance along the lane.

    It may keep the total speed, so that the entity is slower along its lane.
    """

    def __init__(
        self, profile: Transition, *, over_time: bool = True, keeps_speed: bool = False, ends: bool = True
    ) -> None:
        super().__init__()
        self._profile, self._over_time, self._keeps_speed = profile, over_time, keeps_speed
        self._ends, self._at = ends, 0.0

    def steer(self, stage: Stage, body: Body, distance_m: float) -> None:
        """As in ``Motion``."""
        next_at = self._at + (stage.tick_s if self._over_time else abs(distance_m))
        share = self._along_share(next_at, distance_m) if self._keeps_speed and distance_m else 1.0
        self._at = next_at if self._over_time else self._at + abs(distance_m) * share
        stage.mover.drive(body, distance_m * share)
        if body.place is None:
            self.done = True
            return
        body.along_share = share
        rate = 1.0 if self._over_time else abs(body.along_mps)
        self.done = self._at >= self._profile.length - 1e-9 and self._ends
        at = self._profile.length if self.done else self._at
        body.lateral_mps = self._profile.slope(at) * rate
        body.place = replace(body.place, offset_m=self._profile.value(at) * side_of(body.place))
        stage.mover.pose_on_lane(body)

    def _along_share(self, next_at: float, distance_m: float) -> float:
        """Part of the distance of a tick that is along the lane."""
        if not self._over_time:
            return 1.0 / math.hypot(1.0, self._profile.slope((self._at + next_at) / 2.0))
        aside = (self._profile.value(next_at) - self._profile.value(self._at)) / distance_m
        return math.sqrt(max(1.0 - aside**2, 0.0))


class KeepLateral(Moving):
    """A lateral distance to another entity on parallel lanes, within a lateral speed."""

    def __init__(self, element: Element) -> None:
        super().__init__()
        self._element = element

    def steer(self, stage: Stage, body: Body, distance_m: float) -> None:
        """As in ``Motion``."""
        stage.mover.drive(body, distance_m)
        other = stage.bodies[self._element.entity_ref]
        if body.place is None:
            self.done = True
            return
        along_rad = stage.mover.direction_rad(body.place)
        arm_m = (other.position_m - body.position_m)[:2]
        left_m = float(math.cos(along_rad) * arm_m[1] - math.sin(along_rad) * arm_m[0])  # of the other one
        want_m = self._element.distance_m or 0.0
        if self._element.freespace:
            want_m += (body.size_m[1] + other.size_m[1]) / 2.0
        side = {"leftToReferencedEntity": -1.0, "rightToReferencedEntity": 1.0}.get(self._element.displacement)
        shift_m = left_m - want_m * (math.copysign(1.0, left_m) if side is None else side)
        limits = self._element.dynamic_constraints
        most_m = stage.tick_s * (math.inf if limits is None else limits.max_speed_mps or math.inf)
        step_m = min(max(shift_m, -most_m), most_m)
        body.lateral_mps = 0.0 if limits is None else step_m / stage.tick_s
        body.place = replace(body.place, offset_m=body.place.offset_m + step_m * side_of(body.place))
        stage.mover.pose_on_lane(body)
        self.done = self.done or (abs(shift_m - step_m) < _REACHED_M and not self._element.continuous)


class FollowTrajectory(Moving):
    """A trajectory with the entity's own speed, or with the times of its points."""

    def __init__(self, element: Element, stage: Stage) -> None:
        super().__init__()
        self._curve = curve_of(element.trajectory, stage.positions.pose)
        self._at_m = element.initial_distance_offset_m
        self.timing = element.timing if self._curve.time_s is not None else None
        self._start_s = stage.time_s

    def remaining_m(self, goal: Pose) -> float:
        """Distance along the trajectory to the point of it that is next to a position."""
        nearest = np.hypot(*(self._curve.points_m[:, :2] - goal.position_m[:2]).T).argmin()
        low, high = max(nearest - 1, 0), min(nearest + 1, len(self._curve.points_m) - 1)
        best = float(self._curve.distance_m[nearest]), math.inf
        for row in range(low, high):
            leg_m = self._curve.points_m[row + 1, :2] - self._curve.points_m[row, :2]
            length_m = max(float(np.hypot(*leg_m)), 1e-9)
            along_m = float((goal.position_m[:2] - self._curve.points_m[row, :2]) @ leg_m) / length_m
            along_m = min(max(along_m, 0.0), length_m)
            foot_m = self._curve.points_m[row, :2] + along_m / length_m * leg_m
            off_m = float(np.hypot(*(foot_m - goal.position_m[:2])))
            best = min(best, (float(self._curve.distance_m[row]) + along_m, off_m), key=lambda each: each[1])
        return best[0] - self._at_m

    def place(self, stage: Stage, body: Body) -> None:
        """Put the entity where it is on the trajectory."""
        pose = self._curve.pose(self._at_m)
        body.place, body.lateral_mps = None, 0.0
        body.position_m, body.yaw_rad = stage.mover.on_ground(pose.position_m), math.remainder(pose.yaw_rad, math.tau)

    def distance_m(self, stage: Stage, body: Body) -> float:
        """As in ``Motion``; only with times."""
        now_s = self._own_time_s(stage)
        assert self.timing is not None and self._curve.time_s is not None
        body.speed_mps = self._curve.speed_at(min(now_s, self._curve.time_s[-1] - 1e-9)) / self.timing.scale
        late_s = max(now_s - float(self._curve.time_s[-1]), 0.0) * self.timing.scale
        return self._curve.distance_at(now_s) - self._at_m + late_s * body.speed_mps

    def _own_time_s(self, stage: Stage) -> float:
        assert self.timing is not None
        since_s = self._start_s if self.timing.domain_absolute_relative == "relative" else 0.0
        return float((stage.time_s - since_s - self.timing.offset_s) / self.timing.scale)

    def steer(self, stage: Stage, body: Body, distance_m: float) -> None:
        """As in ``Motion``."""
        self._at_m += distance_m
        self.place(stage, body)
        late = self.timing is None or self._own_time_s(stage) >= self._curve.time_s[-1] - 1e-9  # type: ignore[index]
        if self._at_m >= self._curve.length_m - 1e-9 and late:
            beyond_m, self.done = self._at_m - self._curve.length_m, True
            stage.mover.put(body, Pose(body.position_m, body.yaw_rad, None, body.pitch_rad, body.roll_rad))
            stage.mover.drive(body, beyond_m)


class AcquirePosition(Moving):
    """The shortest way to a position: over roads, or straight to it."""

    def __init__(self, goal: Pose) -> None:
        super().__init__()
        self._goal = goal

    def steer(self, stage: Stage, body: Body, distance_m: float) -> None:
        """As in ``Motion``."""
        left_m = float(np.hypot(*(self._goal.position_m - body.position_m)[:2]))
        if body.place is not None:
            left_m = _remaining_m(stage, body, self._goal)
        super().steer(stage, body, distance_m)
        self.done = left_m <= abs(distance_m) + _REACHED_M


def target_mps(stage: Stage, target: Element) -> float:
    """The speed that a target of a speed action asks for."""
    if target.kind == "AbsoluteTargetSpeed":
        return float(target.value_mps)
    other_mps = stage.bodies[target.entity_ref].speed_mps
    return float(other_mps * target.value if target.speed_target_value_type == "factor" else other_mps + target.value)
