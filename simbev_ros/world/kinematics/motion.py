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
from simbev_ros.world.kinematics.collisions import Collisions
from simbev_ros.world.kinematics.contacts import Boxes
from simbev_ros.world.kinematics.footing import Contacts, Footing
from simbev_ros.world.kinematics.moving_average import Window

_GRAVITY_MPS2 = 9.81
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
        boxes: Of those that follow points.
    """

    point: Int64Array
    trail_m: Float64Array
    lead_m: Float64Array
    leans: BoolArray
    mount_m: Float64Array
    contacts: Contacts
    boxes: Boxes


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
    """The motion of all bodies of a scene; one ``advance`` for each tick.

    Attributes:
        collisions: Those among the poses one tick after the ones that ``advance`` returns.
    """

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
        poses = self._poses(np.zeros(len(point_m)), point_m[:, 3])
        self.collisions = Collisions(bodies.boxes, *poses, tick_s)
        position_m, rpy_rad = self._mounted(*poses)
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
        poses = self._poses(self._follow(smoothed[:, :3]), smoothed[:, 3])
        position_m, rpy_rad = self._mounted(*self.collisions.resolve(*poses))
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
        """(G, 3) origins and (G, 3) roll, pitch, yaw, for bodies that lean by (G,) and stand (G,) above the road."""
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
        return np.stack([x_m, y_m, z_m], axis=1), np.stack([roll_rad, pitch_rad, yaw_rad], axis=1)

    def _mounted(self, origin_m: Float64Array, rpy_rad: Float64Array) -> tuple[Float64Array, Float64Array]:
        """(N, 3) origins and (N, 3) roll, pitch, yaw of all bodies, of those (G, 3) of who follows a point."""
        bodies = self._bodies
        rpy_rad = rpy_rad[bodies.point]
        mount_m = np.einsum("nij,nj->ni", rotations_from_rpy(rpy_rad), bodies.mount_m)
        return origin_m[bodies.point] + mount_m, rpy_rad

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
