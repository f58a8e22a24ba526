"""From SUMO's points to rigid bodies in smooth motion: filtered paths, headings that trail, and their derivatives.

SUMO moves a point for each actor along polylines: speed jumps from step to step, direction at every corner. Here the
points are averaged over a short window centred on each tick, so the world is a fixed delay behind SUMO but has no
lag of phase. Each body then follows its point like a vehicle: the point leads, and the rear axle is drawn after it (a
tractrix). On maps with heights it then settles on the ground below its wheels, which takes a little longer. Velocities
and accelerations are central differences of the poses, so that they integrate back to them. All is in the map frame.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.geometry.transforms import rotations_from_rpy
from simbev_ros.types import BoolArray, Float64Array, Int64Array
from simbev_ros.world.footing import Contacts, Footing
from simbev_ros.world.window import Window

_GRAVITY_MPS2 = 9.81
_MAKING_UP = 0.1  # metres to the side or along, per metre driven
_SETTLING = 0.4  # heights are averaged over so much of the window of the points: long enough for springs


@dataclass(frozen=True, slots=True)
class Bodies:
    """How N bodies hang on G leading points (a rider and the bicycle below share one).

    Attributes:
        point: (N,) int64 index of the leading point of each body.
        trail_m: (G,) distance from the leading point back to the rear axle.
        lead_m: (G,) distance of the leading point ahead of the body's origin.
        leans: (G,) bool; whether the body leans into curves, as two-wheelers do.
        mount_m: (N, 3) the body's origin in the frame of the one that follows the point; zero for that one itself.
        contacts: Where those that follow points touch the ground.
    """

    point: Int64Array
    trail_m: Float64Array
    lead_m: Float64Array
    leans: BoolArray
    mount_m: Float64Array
    contacts: Contacts


@dataclass(frozen=True, slots=True)
class Kinematics:
    """Poses of N bodies at one tick and their derivatives.

    Attributes:
        position_m: (N, 3).
        rpy_rad: (N, 3) roll, pitch, yaw.
        velocity_mps: (N, 3).
        acceleration_mps2: (N, 3).
        angular_velocity_radps: (N, 3).
        advance_m: (N,) distance covered along the heading since the tick before.
        speed_mps: (N,) velocity along the heading.
        gain_mps2: (N,) acceleration along the heading.
    """

    position_m: Float64Array
    rpy_rad: Float64Array
    velocity_mps: Float64Array
    acceleration_mps2: Float64Array
    angular_velocity_radps: Float64Array
    advance_m: Float64Array
    speed_mps: Float64Array
    gain_mps2: Float64Array


class Motion:
    """The motion of all bodies of a scene; one ``advance`` for each tick."""

    def __init__(
        self,
        bodies: Bodies,
        point_m: Float64Array,
        direction: Float64Array,
        tick_s: float,
        half_window_ticks: int,
        footing: Footing | None = None,
    ) -> None:
        """At rest.

        Args:
            bodies: What moves.
            point_m: (G, 4) leading points, and how high above the carriageway the body stands.
            direction: (G, 3) unit vectors in which the bodies look.
            tick_s: Time between two points.
            half_window_ticks: Points on each side that an average takes in.
            footing: The ground below the bodies; None: it is level, and they stand at the heights of their points.
        """
        self._bodies = bodies
        self._tick_s = tick_s
        self._footing = footing
        self._points = Window(half_window_ticks)
        half_settling_ticks = 0 if footing is None else max(1, round(half_window_ticks * _SETTLING))
        self._plans, self._planes = Window(half_settling_ticks), Window(half_settling_ticks)
        self._points.add(point_m)
        self._lead_m = point_m[:, :3].copy()
        self._rear_m = self._lead_m - bodies.trail_m[:, None] * direction
        position_m, rpy_rad = self._poses(np.zeros(len(point_m)), point_m[:, 3])
        self._position_m = np.repeat(position_m[None], 3, axis=0)
        self._rpy_rad = np.repeat(rpy_rad[None], 3, axis=0)

    @property
    def delay_ticks(self) -> int:
        """How many points before the newest one the returned kinematics are."""
        return self._points.half_ticks + self._plans.half_ticks + 1

    def advance(self, point_m: Float64Array) -> Kinematics:
        """Take the next (G, 4) leading points; the kinematics at ``delay_ticks`` before them."""
        self._points.add(point_m)
        smoothed = self._points.average()
        position_m, rpy_rad = self._poses(self._follow(smoothed[:, :3]), smoothed[:, 3])
        self._position_m = np.concatenate([self._position_m[1:], position_m[None]])
        self._rpy_rad = np.concatenate([self._rpy_rad[1:], rpy_rad[None]])
        return self._kinematics()

    def _follow(self, lead_m: Float64Array) -> Float64Array:
        """Draw the rear axles after the leading points; (G,) roll with which the body then leans into its curve.

        An axle whose point did not move keeps its place to the last bit.
        """
        forward_m = self._lead_m - self._rear_m
        pull_m = lead_m - self._rear_m
        rear_m = lead_m - (self._bodies.trail_m / np.linalg.norm(pull_m, axis=1))[:, None] * pull_m
        step_m = lead_m - self._lead_m
        self._rear_m = np.where(np.any(step_m != 0.0, axis=1)[:, None], rear_m, self._rear_m)
        self._lead_m = lead_m
        turn_rad = _cross(forward_m, pull_m) / np.einsum("gi,gi->g", forward_m, pull_m)
        sideways_mps2 = turn_rad * np.linalg.norm(step_m, axis=1) / self._tick_s**2
        return np.where(self._bodies.leans, -np.arctan(sideways_mps2 / _GRAVITY_MPS2), 0.0)

    def _poses(self, lean_rad: Float64Array, raised_m: Float64Array) -> tuple[Float64Array, Float64Array]:
        """(N, 3) origins and (N, 3) roll, pitch, yaw, for bodies that lean by (G,) and stand (G,) above the road."""
        bodies = self._bodies
        forward = (self._lead_m - self._rear_m) / bodies.trail_m[:, None]
        origin_m = self._lead_m - bodies.lead_m[:, None] * forward
        planes = np.stack([origin_m[:, 2], np.zeros(len(forward)), np.zeros(len(forward))], axis=1)
        if self._footing is not None:
            planes = self._footing.planes(origin_m, forward)
        planes[:, 0] += raised_m
        self._plans.add(np.stack([*origin_m[:, :2].T, lean_rad, np.arctan2(forward[:, 1], forward[:, 0])], axis=1))
        self._planes.add(planes)
        x_m, y_m, lean_rad, yaw_rad = self._plans.middle.T
        z_m, rise_ahead, rise_left = self._planes.average().T
        pitch_rad = -np.arctan(rise_ahead)
        roll_rad = lean_rad + np.arctan(rise_left * np.cos(pitch_rad))
        rpy_rad = np.stack([roll_rad, pitch_rad, yaw_rad], axis=1)[bodies.point]
        origin_m = np.stack([x_m, y_m, z_m], axis=1)[bodies.point]
        return origin_m + np.einsum("nij,nj->ni", rotations_from_rpy(rpy_rad), bodies.mount_m), rpy_rad

    def _kinematics(self) -> Kinematics:
        """Central differences about the middle one of the three latest poses."""
        before, now, after = self._position_m
        velocity = (after - before) / (2.0 * self._tick_s)
        acceleration = (after - 2.0 * now + before) / self._tick_s**2
        rpy_rad = self._rpy_rad[1]
        turn_rad = self._rpy_rad[2] - self._rpy_rad[0]
        rates = ((turn_rad + np.pi) % (2.0 * np.pi) - np.pi) * (turn_rad != 0.0) / (2.0 * self._tick_s)
        forward = rotations_from_rpy(rpy_rad)[:, :, 0]
        return Kinematics(
            position_m=now,
            rpy_rad=rpy_rad,
            velocity_mps=velocity,
            acceleration_mps2=acceleration,
            angular_velocity_radps=_angular_velocity(rpy_rad, rates),
            advance_m=np.einsum("ni,ni->n", now - before, forward),
            speed_mps=np.einsum("ni,ni->n", velocity, forward),
            gain_mps2=np.einsum("ni,ni->n", acceleration, forward),
        )


class Pursuit:
    """Points that run after targets no faster than they could, so that a target's jump becomes a stretch of way."""

    def __init__(self, target_m: Float64Array, reach_m: Float64Array) -> None:
        """At the (G, 3) targets; (G,) ``reach_m`` is the longest way in one tick."""
        self._position_m = target_m.copy()
        self._reach_m = reach_m

    def advance(self, target_m: Float64Array) -> Float64Array:
        """(G, 3) points one tick later."""
        way_m = target_m - self._position_m
        distance_m = np.linalg.norm(way_m, axis=1)
        share = np.minimum(1.0, self._reach_m / np.maximum(distance_m, 1e-9))
        self._position_m = np.where((share < 1.0)[:, None], self._position_m + share[:, None] * way_m, target_m)
        return self._position_m


class Steady:
    """Points that follow targets as vehicles can: where a target jumps, they go on and make up for it on their way."""

    def __init__(self, target_m: Float64Array, most_change_m: float) -> None:
        """At the (G, 3) targets, at rest; by ``most_change_m`` at most the way of a tick differs from the last one."""
        self._target_m = target_m
        self._most_change_m = most_change_m
        self._step_m = np.zeros((len(target_m), 2))
        self._offset_m = np.zeros((len(target_m), 2))

    def advance(self, target_m: Float64Array) -> Float64Array:
        """(G, 3) points one tick later; exactly the targets of those that did not jump lately."""
        step_m = (target_m - self._target_m)[:, :2]
        change_m = step_m - self._step_m
        share = self._most_change_m / np.maximum(np.linalg.norm(change_m, axis=1), 1e-9)
        possible_m = np.where((share < 1.0)[:, None], self._step_m + share[:, None] * change_m, step_m)
        offset_m = self._offset_m + (possible_m - step_m)
        distance_m = np.linalg.norm(offset_m, axis=1)
        made_up_m = np.minimum(distance_m, _MAKING_UP * np.linalg.norm(possible_m, axis=1))
        self._offset_m = offset_m * (1.0 - made_up_m / np.maximum(distance_m, 1e-9))[:, None]
        self._target_m, self._step_m = target_m, possible_m
        point_m = target_m.copy()
        point_m[:, :2] += self._offset_m
        return point_m


def _cross(a: Float64Array, b: Float64Array) -> Float64Array:
    """(G,) z component of the cross products of (G, 3) vectors."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _angular_velocity(rpy_rad: Float64Array, rates_radps: Float64Array) -> Float64Array:
    """(N, 3) angular velocity in the parent frame of (N, 3) roll, pitch, yaw (Rz Ry Rx) and their rates."""
    pitch, yaw = rpy_rad[:, 1], rpy_rad[:, 2]
    roll_rate, pitch_rate, yaw_rate = rates_radps.T
    return np.stack(
        [
            np.cos(yaw) * np.cos(pitch) * roll_rate - np.sin(yaw) * pitch_rate,
            np.sin(yaw) * np.cos(pitch) * roll_rate + np.cos(yaw) * pitch_rate,
            yaw_rate - np.sin(pitch) * roll_rate,
        ],
        axis=1,
    )
