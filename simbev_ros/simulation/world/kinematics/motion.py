"""Rigid bodies in smooth motion from SUMO's points: filtered paths, towed headings, and their derivatives.

SUMO moves a point for each actor along polylines, so that speed jumps from step to step and direction at every corner.
This module averages the points over a short window centered on each tick, so the world is a fixed delay behind SUMO but
has no phase lag. Each body then follows its point like a vehicle: the point leads, and the rear axle is towed behind it
(a tractrix). The axle of a vehicle driven from outside is given, as a tractrix is unstable in reverse; a vehicle that
follows commands is not averaged, so that these act without this delay. On maps with elevation, the body settles on the
ground below its wheels, which adds a little delay. Velocities and accelerations are central differences of the poses,
so that they integrate back to them. Everything is in the map frame.
"""

from collections import deque
from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np

from simbev_ros.foundation.geometry.transforms import rotations_from_rpy
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array, Table
from simbev_ros.foundation.units import GRAVITY_MPS2
from simbev_ros.schema.scene.state import ACTOR_DTYPE
from simbev_ros.simulation.world.kinematics.collisions import Collisions
from simbev_ros.simulation.world.kinematics.contacts import BodyBoxes
from simbev_ros.simulation.world.kinematics.footing import ContactPoints, GroundPlanes
from simbev_ros.simulation.world.kinematics.towing import TowedUnits, Towing

_SETTLING_FRACTION = 0.4  # window for heights divided by the points' window: long enough to act like springs


@dataclass(frozen=True, slots=True)
class Bodies:
    """How N bodies hang on G leading points (a rider and the bicycle below share one).

    Vehicles come first, then the units that they tow, whose points are their hitches, then pedestrians.

    Attributes:
        point: (N,) int64 index of each body's leading point.
        trail_m: (G,) distance from the leading point back to the rear axle.
        lead_m: (G,) distance from the body's origin forward to the leading point.
        leans: (G,) bool; whether the body leans into curves, as two-wheelers do.
        mount_m: (N, 3) the body's origin in the frame of the body that follows the point; zero for that body itself.
        contacts: Contact points of the bodies that follow points.
        boxes: Boxes of the bodies that follow points.
        towing: How the towed units hang on vehicles.
    """

    point: Int64Array
    trail_m: Float64Array
    lead_m: Float64Array
    leans: BoolArray
    mount_m: Float64Array
    contacts: ContactPoints
    boxes: BodyBoxes
    towing: Towing = field(default_factory=Towing)

    @property
    def towed(self) -> slice:
        """Rows of the towed units among the G bodies."""
        return slice(self.boxes.vehicles - len(self.towing.leader), self.boxes.vehicles)

    def with_towed(self, rows: Float64Array) -> Float64Array:
        """(G, …) rows from those of the bodies that SUMO knows; towed units have those of their vehicles."""
        return np.concatenate([rows[: self.towed.start], rows[self.towing.leader], rows[self.towed.start :]])


@dataclass(frozen=True, slots=True)
class Kinematics:
    """Poses of N bodies at one tick and their derivatives, map frame.

    Attributes:
        position_m: (N, 3).
        rpy_rad: (N, 3) roll, pitch, yaw.
        velocity_mps: (N, 3).
        acceleration_mps2: (N, 3).
        angular_velocity_radps: (N, 3).
        distance_m: (N,) distance covered along the heading since the tick before.
        speed_mps: (N,) velocity along the heading.
        forward_acceleration_mps2: (N,) acceleration along the heading.
    """

    position_m: Float64Array
    rpy_rad: Float64Array
    velocity_mps: Float64Array
    acceleration_mps2: Float64Array
    angular_velocity_radps: Float64Array
    distance_m: Float64Array
    speed_mps: Float64Array
    forward_acceleration_mps2: Float64Array


class _MovingAverage:
    """Average of the latest values around the middle one, with weights that vanish at both ends."""

    def __init__(self, half_ticks: int) -> None:
        """For ``half_ticks`` values on each side of the middle one."""
        self.half_ticks = half_ticks
        weights = np.hanning(2 * half_ticks + 3)[1:-1]
        self._weights = weights / weights.sum()
        self._values: deque[Float64Array] = deque(maxlen=len(weights))

    def add(self, values: Float64Array) -> None:
        """Add the newest values; before the first call, values are taken as constant."""
        self._values.extend([values] * (1 if self._values else len(self._weights)))

    @property
    def middle(self) -> Float64Array:
        """The values ``half_ticks`` before the newest ones."""
        return self._values[self.half_ticks]

    def average(self) -> Float64Array:
        """The average around the middle; exactly the middle value where nothing changed."""
        middle = self.middle
        deviation = (np.stack(self._values) - middle).reshape(len(self._values), -1)
        return middle + np.dot(self._weights[None], deviation).reshape(middle.shape)


class Motion:
    """The motion of all bodies of a scene. Call ``advance_motion`` once per tick.

    Attributes:
        collisions: Collisions, also with parked vehicles, among the poses one tick after those that ``advance_motion``
            returns.
    """

    def __init__(
        self,
        bodies: Bodies,
        point_m: Float64Array,
        direction: Float64Array,
        tick_s: float,
        half_window_ticks: int,
        ground_planes: GroundPlanes | None = None,
        axle_m: Float64Array | None = None,
        parked: Table | None = None,
        unsmoothed: Collection[int] = (),
    ) -> None:
        """Start at rest.

        Args:
            bodies: The bodies that move.
            point_m: (G - T, 4) leading points, and the height of each body above the carriageway; those of the T towed
                units follow from them.
            direction: (G - T, 3) unit vectors of the headings.
            tick_s: Time between two points.
            half_window_ticks: Number of points on each side of the center of an average.
            ground_planes: The ground below the bodies; None: level ground, bodies stand at the heights of their points.
            axle_m: (G - T, 3) rear axles that are given at each tick; NaN: towed; None: all are towed.
            parked: (K,) ``ACTOR_DTYPE`` vehicles that never move, into which bodies may crash; None: there are none.
            unsmoothed: Indices of points with given axles that move smoothly by themselves and are neither averaged
                nor delayed by that.
        """
        self._bodies = bodies
        self._tick_s = tick_s
        self._ground_planes = ground_planes
        self._point_window = _MovingAverage(half_window_ticks)
        half_settling_ticks = 0 if ground_planes is None else max(1, round(half_window_ticks * _SETTLING_FRACTION))
        self._plan_window, self._plane_window = _MovingAverage(half_settling_ticks), _MovingAverage(half_settling_ticks)
        self._point_window.add(point_m)
        axle_m = np.full((len(point_m), 3), np.nan) if axle_m is None else axle_m
        self._steered = np.flatnonzero(~np.isnan(axle_m[:, 0]))
        self._unsmoothed = np.array(sorted(unsmoothed), np.int64)
        self._axle_window = _MovingAverage(half_window_ticks)
        self._axle_window.add(axle_m[self._steered])
        point_m, direction = bodies.with_towed(point_m), bodies.with_towed(direction)
        self._lead_m = point_m[:, :3].copy()
        self._towed_units = TowedUnits(bodies.towing, self._lead_m, direction)
        self._lead_m[bodies.towed] = self._towed_units.hitch_m
        self._rear_m = self._lead_m - bodies.trail_m[:, None] * direction
        poses = self._poses(np.zeros(len(point_m)), point_m[:, 3])
        parked = np.zeros(0, ACTOR_DTYPE) if parked is None else parked
        self._parked = _columns(parked, "x", "y", "z"), _columns(parked, "roll", "pitch", "yaw")
        size_m = np.concatenate([bodies.boxes.size_m, _columns(parked, "length", "width", "height")])
        boxes = BodyBoxes(size_m, bodies.boxes.vehicles)
        coupled = np.column_stack([bodies.towing.leader, np.arange(bodies.towed.start, bodies.towed.stop)])
        self.collisions = Collisions(boxes, *self._beside_parked(poses), tick_s, len(parked), coupled)
        position_m, rpy_rad = self._mount_bodies(*poses)
        self._position_m = np.repeat(position_m[None], 3, axis=0)
        self._rpy_rad = np.repeat(rpy_rad[None], 3, axis=0)

    @property
    def delay_ticks(self) -> int:
        """Number of points by which the returned kinematics are behind the newest point."""
        return self._point_window.half_ticks + self.unsmoothed_delay_ticks

    @property
    def unsmoothed_delay_ticks(self) -> int:
        """Likewise for points that are not averaged."""
        return self._plan_window.half_ticks + 1

    def advance_motion(self, point_m: Float64Array, axle_m: Float64Array | None = None) -> Kinematics:
        """Take the next (G - T, 4) leading points and (G - T, 3) rear axles as at the start.

        Returns:
            The kinematics ``delay_ticks`` before them.
        """
        self._point_window.add(point_m)
        points_m, rows = self._point_window.average(), self._unsmoothed
        points_m[rows] = point_m[rows]
        smoothed = self._bodies.with_towed(points_m)
        if axle_m is not None:
            self._axle_window.add(axle_m[self._steered])
        axles_m = self._axle_window.average()
        if axle_m is not None:
            axles_m[np.searchsorted(self._steered, rows)] = axle_m[rows]
        poses = self._poses(self._move_axles(smoothed[:, :3], axles_m), smoothed[:, 3])
        resolved = self.collisions.resolve(*self._beside_parked(poses))
        position_m, rpy_rad = self._mount_bodies(*(pose[: len(smoothed)] for pose in resolved))
        self._position_m = np.concatenate([self._position_m[1:], position_m[None]])
        self._rpy_rad = np.concatenate([self._rpy_rad[1:], rpy_rad[None]])
        return self._kinematics()

    def _beside_parked(self, poses: tuple[Float64Array, Float64Array]) -> tuple[Float64Array, Float64Array]:
        """(G + K, 3) positions and roll, pitch, yaw of the bodies, then of the parked vehicles."""
        position_m, rpy_rad = (np.concatenate(pair) for pair in zip(poses, self._parked, strict=True))
        return position_m, rpy_rad

    def _move_axles(self, lead_m: Float64Array, axle_m: Float64Array) -> Float64Array:
        """Tow the rear axles behind the (G, 3) leading points, except the given (S, 3) ones, which push their points.

        An axle whose point did not move keeps its position to the last bit.

        Returns:
            (G,) roll of bodies that lean into their curve.
        """
        steered, old_forward_m = self._steered, self._lead_m - self._rear_m
        to_lead_m = lead_m - self._rear_m
        to_lead_m[steered] = lead_m[steered] - axle_m
        forward_m = (self._bodies.trail_m / np.linalg.norm(to_lead_m, axis=1))[:, None] * to_lead_m
        lead_m[steered] = axle_m + forward_m[steered]
        towed, units, trail_m = self._bodies.towed, self._towed_units, self._bodies.trail_m[:, None]
        units.follow(lead_m, forward_m / trail_m)
        lead_m[towed], forward_m[towed] = units.hitch_m, trail_m[towed] * units.forward
        rear_m = lead_m - forward_m
        step_m = lead_m - self._lead_m
        self._rear_m = np.where(np.any(step_m != 0.0, axis=1)[:, None], rear_m, self._rear_m)
        self._lead_m = lead_m
        turn_rad = _cross(old_forward_m, to_lead_m) / np.einsum("gi,gi->g", old_forward_m, to_lead_m)
        turn_rad[steered] *= np.sign(np.einsum("si,si->s", step_m[steered], forward_m[steered]))
        lateral_mps2 = turn_rad * np.linalg.norm(step_m, axis=1) / self._tick_s**2
        return np.where(self._bodies.leans, -np.arctan(lateral_mps2 / GRAVITY_MPS2), 0.0)

    def _poses(self, lean_rad: Float64Array, raised_m: Float64Array) -> tuple[Float64Array, Float64Array]:
        """(G, 3) origins and (G, 3) roll, pitch, yaw of bodies that lean by (G,) and stand (G,) above the road."""
        bodies = self._bodies
        forward = (self._lead_m - self._rear_m) / bodies.trail_m[:, None]
        origin_m = self._lead_m - bodies.lead_m[:, None] * forward
        planes = np.stack([origin_m[:, 2], np.zeros(len(forward)), np.zeros(len(forward))], axis=1)
        if self._ground_planes is not None:
            planes = self._ground_planes.fit_planes(origin_m, forward)
        planes[:, 0] += raised_m
        self._plan_window.add(
            np.stack([*origin_m[:, :2].T, lean_rad, np.arctan2(forward[:, 1], forward[:, 0])], axis=1)
        )
        self._plane_window.add(planes)
        x_m, y_m, lean_rad, yaw_rad = self._plan_window.middle.T
        z_m, rise_ahead, rise_left = self._plane_window.average().T
        pitch_rad = -np.arctan(rise_ahead)
        roll_rad = lean_rad + np.arctan(rise_left * np.cos(pitch_rad))
        return np.stack([x_m, y_m, z_m], axis=1), np.stack([roll_rad, pitch_rad, yaw_rad], axis=1)

    def _mount_bodies(self, origin_m: Float64Array, rpy_rad: Float64Array) -> tuple[Float64Array, Float64Array]:
        """(N, 3) origins and (N, 3) roll, pitch, yaw of all bodies, from the (G, 3) of those that follow points."""
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
            distance_m=np.einsum("ni,ni->n", now - before, forward),
            speed_mps=np.einsum("ni,ni->n", velocity, forward),
            forward_acceleration_mps2=np.einsum("ni,ni->n", acceleration, forward),
        )


def _columns(rows: Table, *names: str) -> Float64Array:
    """(K, 3) columns of a table."""
    return np.column_stack([rows[name].astype(np.float64) for name in names])


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
