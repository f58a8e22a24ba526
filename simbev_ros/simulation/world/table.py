"""Assembly of the actors table: the cast's constant columns, poses and derivatives, wheels, gaits, lights and doors."""

import numpy as np

from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array, Table, UInt8Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.scene.gait import stride_lengths_m
from simbev_ros.scene.weather_course import WeatherCourse
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID, Behavior
from simbev_ros.simulation.world.cast import Cast
from simbev_ros.simulation.world.driving.outside_drivers import driven_from_outside
from simbev_ros.simulation.world.kinematics.motion import Kinematics
from simbev_ros.simulation.world.lights import BEACON_HZ, BLINKER_HZ, is_bright, vehicle_lights

_MAX_STEER_RAD = 0.7
_MAX_STEER_RATE_RADPS = 1.5
_MIN_STEERING_MPS = 0.3


class ActorTable:
    """Fills one table per tick; keeps the rotation of wheels and legs."""

    def __init__(self, spec: SceneSpec, weather: WeatherCourse, cast: Cast, vehicles: int, tunnels: Tunnels) -> None:
        """For a cast whose first ``vehicles`` rows are vehicles, on a map with these tunnels."""
        self._cast = cast
        self._tunnels = tunnels
        self._spec, self._weather = spec, weather
        self._tick_s = spec.tick_ns / NS_PER_S
        self._blink_phases = np.array(
            [stream(spec.seed, f"vehicles.{row['id'] - EGO_ID}.blinker").random() for row in cast.rows[:vehicles]]
        )
        self._has_beacon = np.array(
            [spec.vehicles[row["id"] - EGO_ID].emergency_lights for row in cast.rows[:vehicles]]
        )
        driven = np.isin(cast.rows["id"] - EGO_ID, list(driven_from_outside(spec)))
        self._reverses = driven | bool(spec.map.path)  # there, drivers back off
        # A rider pedals by the distance of its bicycle; the row of a vehicle equals the index of its leading point.
        self._distance_row = np.where(cast.rows["parent"] > 0, cast.bodies.point, np.arange(len(cast.rows)))
        points = cast.bodies.point
        self._towed = np.flatnonzero((points >= cast.bodies.towed.start) & (points < cast.bodies.towed.stop))
        self._steer_rad = np.zeros(len(cast.rows))
        self._wheel_rad = np.zeros(len(cast.rows))
        self._gait_rad = np.zeros(len(cast.rows))

    def fill(
        self, motion: Kinematics, signals: Int64Array, doors: UInt8Array, jaywalking: BoolArray, step: int
    ) -> Table:
        """(N,) ``ACTOR_DTYPE`` of the next step.

        Args:
            motion: Kinematics of the cast's rows.
            signals: (V,) SUMO's vehicle signals.
            doors: (V,) bits of open doors.
            jaywalking: (P,) whether each pedestrian crosses a street away from crosswalks.
            step: Ticks since the scene's start.
        """
        table = self._cast.rows.copy()
        for names, values in (
            (("x", "y", "z"), motion.position_m),
            (("roll", "pitch", "yaw"), motion.rpy_rad),
            (("vx", "vy", "vz"), motion.velocity_mps),
            (("ax", "ay", "az"), motion.acceleration_mps2),
            (("wx", "wy", "wz"), motion.angular_velocity_radps),
        ):
            for name, column in zip(names, values.T, strict=True):
                table[name] = column
        self._turn_wheels_and_legs(motion)
        table["steer"], table["wheel"], table["gait"] = self._steer_rad, self._wheel_rad, self._gait_rad
        vehicles = slice(len(self._blink_phases))
        weather = self._weather.at(step - self._spec.warm_up_ticks)
        blinker_bright = is_bright(self._blink_phases, step * self._tick_s, BLINKER_HZ)
        beacon_bright = self._has_beacon & is_bright(self._blink_phases, step * self._tick_s, BEACON_HZ)
        speed_mps, forward_mps2 = motion.speed_mps[vehicles], motion.forward_acceleration_mps2[vehicles]
        in_tunnel = self._tunnels.holds(motion.position_m[vehicles])
        table["lights"][vehicles] = vehicle_lights(
            signals, speed_mps, forward_mps2, blinker_bright, beacon_bright, weather, in_tunnel
        )
        table["lights"][self._towed] = table["lights"][self._cast.bodies.towing.leader]
        table["doors"][vehicles] = doors
        table["behavior"][len(table) - len(jaywalking) :] |= (Behavior.JAYWALKING * jaywalking).astype(np.uint16)
        return table

    def _turn_wheels_and_legs(self, motion: Kinematics) -> None:
        """Turn wheels and legs by the distance covered; steer as the yaw rate demands (kinematic bicycle model)."""
        cast = self._cast
        self._wheel_rad += motion.distance_m / cast.wheel_radius_m
        stride_m = cast.stride_m.copy()
        stride_m[cast.on_foot] = stride_lengths_m(cast.tall_m[cast.on_foot], motion.speed_mps[cast.on_foot])
        turn_rad = 2.0 * np.pi * motion.distance_m[self._distance_row] / stride_m
        self._gait_rad = (self._gait_rad + turn_rad) % (2.0 * np.pi)
        backward = self._reverses & (motion.speed_mps < -_MIN_STEERING_MPS)
        is_rolling = backward | (motion.speed_mps > _MIN_STEERING_MPS)
        rolling_mps = np.where(is_rolling, motion.speed_mps, 1.0)
        steer_rad: Float64Array = np.arctan2(
            np.sign(rolling_mps) * cast.wheelbase_m * motion.angular_velocity_radps[:, 2], np.abs(rolling_mps)
        )
        change_rad = np.clip(steer_rad, -_MAX_STEER_RAD, _MAX_STEER_RAD) - self._steer_rad
        max_change_rad = np.where(
            is_rolling, _MAX_STEER_RATE_RADPS * self._tick_s, 0.0
        )  # a stationary vehicle keeps its wheel angles
        self._steer_rad += np.clip(change_rad, -max_change_rad, max_change_rad)
