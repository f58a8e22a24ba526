"""Short-term trajectory prediction: vehicles along the lanes of their routes, pedestrians straight ahead."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.simulation.world.kinematics.motion import Bodies
from simbev_ros.simulation.world.sumo.traffic import SumoTraffic

TIMES_S = np.arange(13) * 0.3
_MIN_SPAN_M = 0.05
_STARTING_MPS2 = 1.5
_ACCELERATION_S = 1.0  # time for which a current acceleration continues
_SIDEWALK_S = 0.4  # a pedestrian on a sidewalk is expected to stop before the road
_DRIFT_S = 1.0  # time for which a current lane change continues
_MIN_DRIFT_MPS, _MAX_DRIFT_MPS = 0.15, 1.5
_TANGENT_M = 0.5
_MAX_SWERVE_SLOPE = 0.35  # lateral meters per meter driven
_MAX_SWERVE_MPS = 0.6


@dataclass(frozen=True)
class PredictedTrajectories:
    """Predicted poses of N bodies at the K times ``TIMES_S`` from now, in plan.

    Attributes:
        center_m: (N, K, 2) positions.
        forward: (N, K, 2) unit vectors of the headings.
    """

    center_m: Float64Array
    forward: Float64Array

    @cached_property
    def middle_m(self) -> Float64Array:
        """(N, 2) midpoint of the first and the last position."""
        return (self.center_m[:, 0] + self.center_m[:, -1]) / 2.0

    @cached_property
    def span_m(self) -> Float64Array:
        """(N,) distance between the first and the last position."""
        return np.linalg.norm(self.center_m[:, -1] - self.center_m[:, 0], axis=1)

    @cached_property
    def stays(self) -> BoolArray:
        """(N,) whether each body hardly moves."""
        return self.span_m <= _MIN_SPAN_M


class TrajectoryPredictor:
    """Predicts the trajectories of a scene's first V vehicles, which are SUMO's.

    Attributes:
        speed_mps: (V,) speeds.
        left: (V, 2) unit vectors to the left of their paths.
        target_offset_m: (V,) desired lateral offset from SUMO's positions, left positive.
        offset_m: (V,) current lateral offset.
    """

    def __init__(self, bodies: Bodies, front_m: Float64Array, traffic: SumoTraffic, tick_s: float) -> None:
        """Start at rest at the (V, 3) fronts."""
        self.speed_mps: Float64Array = np.zeros(len(front_m))
        self._traffic = traffic
        self._tick_s = tick_s
        vehicles = len(front_m)
        self._trail_m, self._lead_m = bodies.trail_m[:vehicles], bodies.lead_m[:vehicles]
        self._behind_m = bodies.boxes.size_m[:vehicles, 0] / 2.0 - self._lead_m
        self._front_m = self._point_m = self._rear_m = front_m
        self._is_reversing: BoolArray = np.zeros(vehicles, bool)
        self._acceleration_mps2 = np.zeros(vehicles)
        self.left: Float64Array = np.zeros((vehicles, 2))
        self.target_offset_m: Float64Array = np.zeros(vehicles)
        self.offset_m: Float64Array = np.zeros(vehicles)
        self._drift_mps = np.zeros(vehicles)
        self._swerve_mps = np.zeros(vehicles)

    def observe(
        self, front_m: Float64Array, point_m: Float64Array, rear_m: Float64Array, is_reversing: BoolArray
    ) -> None:
        """Take the (V, 3) fronts, leading points and rear axles of the next tick, and whether (V,) move backward."""
        velocity_mps = (front_m - self._front_m)[:, :2] / self._tick_s
        speed_mps = np.linalg.norm(velocity_mps, axis=1)
        self._acceleration_mps2 = (self._acceleration_mps2 + (speed_mps - self.speed_mps) / self._tick_s) / 2.0
        drift_mps = np.sum(self.left * velocity_mps, axis=1) - self._swerve_mps
        drift_mps = np.where(np.abs(drift_mps) > _MIN_DRIFT_MPS, drift_mps, 0.0)
        self._drift_mps = np.clip(drift_mps, -_MAX_DRIFT_MPS, _MAX_DRIFT_MPS)
        self.speed_mps, self._front_m, self._point_m, self._rear_m = speed_mps, front_m, point_m, rear_m
        self._is_reversing = is_reversing
        (vehicle,) = np.nonzero((speed_mps > 0.0) | np.all(self.left == 0.0, axis=1))
        distance_m = np.tile([0.0, _TANGENT_M], (len(vehicle), 1))
        ends_m = self._traffic.ahead_m(vehicle, distance_m, np.zeros_like(distance_m))
        along_m = (ends_m[:, 1] - ends_m[:, 0])[:, :2]
        along = along_m / np.maximum(np.linalg.norm(along_m, axis=1, keepdims=True), 1e-9)
        self.left[vehicle] = left_of(along)
        max_m = np.minimum(_MAX_SWERVE_SLOPE * speed_mps, _MAX_SWERVE_MPS) * self._tick_s
        swerve_m = np.clip(self.target_offset_m - self.offset_m, -max_m, max_m)
        self.offset_m = self.offset_m + swerve_m
        self._swerve_mps = swerve_m / self._tick_s

    def predict(self, vehicle: Int64Array, is_released: bool) -> PredictedTrajectories:
        """Predict (N,) vehicles: as they drive now or, if ``is_released``, as held vehicles would drive off."""
        acceleration_mps2 = np.full(len(vehicle), _STARTING_MPS2) if is_released else self._acceleration_mps2[vehicle]
        distance_m = _distances_m(self.speed_mps[vehicle], np.clip(acceleration_mps2, -8.0, _STARTING_MPS2))
        behind_m = self._behind_m[vehicle, None]
        route_distance_m = np.maximum(distance_m - behind_m, 0.0)
        left_m = self._drift_mps[vehicle, None] * np.minimum(TIMES_S, _DRIFT_S)
        max_m = np.minimum(_MAX_SWERVE_SLOPE * route_distance_m, _MAX_SWERVE_MPS * TIMES_S)
        left_m += np.clip((self.target_offset_m - self.offset_m)[vehicle, None], -max_m, max_m)
        left_m[:, 0] = 0.0
        positions_m = self._traffic.ahead_m(vehicle, route_distance_m, left_m)[..., :2]
        front_m, point_m = self._front_m[vehicle, None, :2], self._point_m[vehicle, None, :2]
        fraction = np.minimum(distance_m / np.maximum(behind_m, 1e-9), 1.0)[..., None]
        lead_m = np.where(
            fraction < 1.0, point_m + fraction * (front_m - point_m), front_m + positions_m - positions_m[:, :1]
        )
        back_m = (point_m - self._rear_m[vehicle, None, :2]) / self._trail_m[vehicle, None, None]
        back_m = point_m - distance_m[..., None] * back_m
        return self._predict_towed(vehicle, np.where(self._is_reversing[vehicle, None, None], back_m, lead_m))

    def _predict_towed(self, vehicle: Int64Array, lead_m: Float64Array) -> PredictedTrajectories:
        """Trajectories of bodies with rear axles towed behind (N, K, 2) points."""
        trail_m, rear_m = self._trail_m[vehicle, None], self._rear_m[vehicle, :2]
        forward = np.empty_like(lead_m)
        for number in range(len(TIMES_S)):
            pull_m = lead_m[:, number] - rear_m
            forward[:, number] = pull_m / np.maximum(np.linalg.norm(pull_m, axis=1, keepdims=True), 1e-9)
            rear_m = lead_m[:, number] - trail_m * forward[:, number]
        return PredictedTrajectories(lead_m - self._lead_m[vehicle, None, None] * forward, forward)


def predict_pedestrians(
    position_m: Float64Array, velocity_mps: Float64Array, on_sidewalk: BoolArray
) -> PredictedTrajectories:
    """Predict pedestrians at (P, 2) with (P, 2) velocities; ``on_sidewalk`` (P,) marks those on a sidewalk."""
    time_s = np.minimum(TIMES_S, np.where(on_sidewalk, _SIDEWALK_S, np.inf)[:, None])
    center_m = position_m[:, None] + velocity_mps[:, None] * time_s[..., None]
    return PredictedTrajectories(center_m, np.broadcast_to([1.0, 0.0], center_m.shape))


def _distances_m(speed_mps: Float64Array, acceleration_mps2: Float64Array) -> Float64Array:
    """(N, K) distances covered while braking to a stop or accelerating for a while."""
    change_end_s = np.where(acceleration_mps2 < 0.0, speed_mps / np.maximum(-acceleration_mps2, 1e-9), _ACCELERATION_S)[
        :, None
    ]
    changing_s = np.minimum(TIMES_S, change_end_s)
    moving_s = np.where(acceleration_mps2[:, None] < 0.0, changing_s, TIMES_S)
    speed_change_m = acceleration_mps2[:, None] * changing_s * (moving_s - changing_s / 2.0)
    return speed_mps[:, None] * moving_s + speed_change_m
