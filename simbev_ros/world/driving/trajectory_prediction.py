"""Where bodies will be in the next seconds: vehicles along the lanes of their routes, people straight on."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from simbev_ros.types import BoolArray, Float64Array, Int64Array
from simbev_ros.world.kinematics.motion import Bodies

TIMES_S = np.arange(13) * 0.3
_LEAST_SPAN_M = 0.05
_STARTING_MPS2 = 1.5
_GAINING_S = 1.0  # a driver who speeds up now does so for so long
_ON_KERB_S = 0.4  # who walks on a sidewalk is taken to stop before the road
_DRIFT_S = 1.0  # a change of lanes goes on for so long
_LEAST_DRIFT_MPS, _MOST_DRIFT_MPS = 0.15, 1.5
_TANGENT_M = 0.5
_SWERVE = 0.35  # metres aside per metre driven
_MOST_SWERVE_MPS = 0.6


class Ways(Protocol):
    """What looking ahead asks of the traffic."""

    def ahead_m(self, vehicle: Int64Array, way_m: Float64Array, left_m: Float64Array) -> Float64Array:
        """(N, K, 3) places of N vehicles' fronts after (N, K) ways, (N, K) farther to the left than now."""


@dataclass(frozen=True, slots=True)
class Course:
    """Poses of N bodies at ``TIMES_S`` from now, in plan.

    Attributes:
        center_m: (N, K, 2).
        forward: (N, K, 2) unit vectors.
    """

    center_m: Float64Array
    forward: Float64Array

    @property
    def middle_m(self) -> Float64Array:
        """(N, 2) places between the first and the last ones."""
        middle_m: Float64Array = (self.center_m[:, 0] + self.center_m[:, -1]) / 2.0
        return middle_m

    @property
    def span_m(self) -> Float64Array:
        """(N,) how far the last places are from the first ones."""
        span_m: Float64Array = np.linalg.norm(self.center_m[:, -1] - self.center_m[:, 0], axis=1)
        return span_m

    @property
    def stays(self) -> BoolArray:
        """(N,) who hardly moves from its place."""
        stays: BoolArray = self.span_m <= _LEAST_SPAN_M
        return stays


class Foresight:
    """Foresees the courses of a scene's first V vehicles, which are SUMO's.

    Attributes:
        speed_mps: (V,) their speeds.
        left: (V, 2) unit vectors to the left of their ways.
        aside_m: (V,) how far to the left of SUMO's places they shall drive.
        is_aside_m: (V,) how far they do.
    """

    def __init__(self, bodies: Bodies, front_m: Float64Array, traffic: Ways, tick_s: float) -> None:
        """At rest at the (V, 3) fronts."""
        self.speed_mps: Float64Array = np.zeros(len(front_m))
        self._traffic = traffic
        self._tick_s = tick_s
        vehicles = len(front_m)
        self._trail_m, self._lead_m = bodies.trail_m[:vehicles], bodies.lead_m[:vehicles]
        self._behind_m = bodies.boxes.size_m[:vehicles, 0] / 2.0 - self._lead_m
        self._front_m = self._point_m = self._rear_m = front_m
        self._gain_mps2 = np.zeros(vehicles)
        self.left: Float64Array = np.zeros((vehicles, 2))
        self.aside_m: Float64Array = np.zeros(vehicles)
        self.is_aside_m: Float64Array = np.zeros(vehicles)
        self._drift_mps = np.zeros(vehicles)
        self._swerve_mps = np.zeros(vehicles)

    def advance(self, front_m: Float64Array, point_m: Float64Array, rear_m: Float64Array) -> None:
        """Take the vehicles' (V, 3) fronts, points and rear axles of the next tick."""
        velocity_mps = (front_m - self._front_m)[:, :2] / self._tick_s
        speed_mps = np.linalg.norm(velocity_mps, axis=1)
        self._gain_mps2 = (self._gain_mps2 + (speed_mps - self.speed_mps) / self._tick_s) / 2.0
        drift_mps = np.sum(self.left * velocity_mps, axis=1) - self._swerve_mps
        drift_mps = np.where(np.abs(drift_mps) > _LEAST_DRIFT_MPS, drift_mps, 0.0)
        self._drift_mps = np.clip(drift_mps, -_MOST_DRIFT_MPS, _MOST_DRIFT_MPS)
        self.speed_mps, self._front_m, self._point_m, self._rear_m = speed_mps, front_m, point_m, rear_m
        (vehicle,) = np.nonzero((speed_mps > 0.0) | np.all(self.left == 0.0, axis=1))
        way_m = np.tile([0.0, _TANGENT_M], (len(vehicle), 1))
        ends_m = self._traffic.ahead_m(vehicle, way_m, np.zeros_like(way_m))
        along_m = (ends_m[:, 1] - ends_m[:, 0])[:, :2]
        along = along_m / np.maximum(np.linalg.norm(along_m, axis=1, keepdims=True), 1e-9)
        self.left[vehicle] = np.column_stack([-along[:, 1], along[:, 0]])
        most_m = np.minimum(_SWERVE * speed_mps, _MOST_SWERVE_MPS) * self._tick_s
        swerve_m = np.clip(self.aside_m - self.is_aside_m, -most_m, most_m)
        self.is_aside_m = self.is_aside_m + swerve_m
        self._swerve_mps = swerve_m / self._tick_s

    def course(self, vehicle: Int64Array, starts: bool) -> Course:
        """Of (N,) vehicles, as they go on now or, for those that are held, as they would if they were let go."""
        gain_mps2 = np.full(len(vehicle), _STARTING_MPS2) if starts else self._gain_mps2[vehicle]
        way_m = _way_m(self.speed_mps[vehicle], np.clip(gain_mps2, -8.0, _STARTING_MPS2))
        behind_m = self._behind_m[vehicle, None]
        beyond_m = np.maximum(way_m - behind_m, 0.0)
        left_m = self._drift_mps[vehicle, None] * np.minimum(TIMES_S, _DRIFT_S)
        most_m = np.minimum(_SWERVE * beyond_m, _MOST_SWERVE_MPS * TIMES_S)
        left_m += np.clip((self.aside_m - self.is_aside_m)[vehicle, None], -most_m, most_m)
        left_m[:, 0] = 0.0
        places_m = self._traffic.ahead_m(vehicle, beyond_m, left_m)[..., :2]
        front_m, point_m = self._front_m[vehicle, None, :2], self._point_m[vehicle, None, :2]
        share = np.minimum(way_m / np.maximum(behind_m, 1e-9), 1.0)[..., None]
        lead_m = np.where(share < 1.0, point_m + share * (front_m - point_m), front_m + places_m - places_m[:, :1])
        return self._towed(vehicle, lead_m)

    def _towed(self, vehicle: Int64Array, lead_m: Float64Array) -> Course:
        """The course of bodies whose rear axles are drawn after (N, K, 2) points."""
        trail_m, rear_m = self._trail_m[vehicle, None], self._rear_m[vehicle, :2]
        forward = np.empty_like(lead_m)
        for number in range(len(TIMES_S)):
            pull_m = lead_m[:, number] - rear_m
            forward[:, number] = pull_m / np.maximum(np.linalg.norm(pull_m, axis=1, keepdims=True), 1e-9)
            rear_m = lead_m[:, number] - trail_m * forward[:, number]
        return Course(lead_m - self._lead_m[vehicle, None, None] * forward, forward)


def walks(position_m: Float64Array, velocity_mps: Float64Array, on_kerb: BoolArray) -> Course:
    """The courses of people at (P, 2) with (P, 2) velocities; (P,) who of them is on a sidewalk."""
    time_s = np.minimum(TIMES_S, np.where(on_kerb, _ON_KERB_S, np.inf)[:, None])
    center_m = position_m[:, None] + velocity_mps[:, None] * time_s[..., None]
    return Course(center_m, np.broadcast_to([1.0, 0.0], center_m.shape))


def _way_m(speed_mps: Float64Array, gain_mps2: Float64Array) -> Float64Array:
    """(N, K) ways at a speed that changes: of who brakes until the stop, of who speeds up for a while."""
    until_s = np.where(gain_mps2 < 0.0, speed_mps / np.maximum(-gain_mps2, 1e-9), _GAINING_S)[:, None]
    changing_s = np.minimum(TIMES_S, until_s)
    going_s = np.where(gain_mps2[:, None] < 0.0, changing_s, TIMES_S)
    gained_m = gain_mps2[:, None] * changing_s * (going_s - changing_s / 2.0)
    way_m: Float64Array = speed_mps[:, None] * going_s + gained_m
    return way_m
