"""The actors table: fixed columns of the cast, poses and derivatives, and what turns and shines because of them."""

import numpy as np

from simbev_ros.random import stream
from simbev_ros.scene.gait import strides_m
from simbev_ros.scene.spec import NS_PER_S, SceneSpec
from simbev_ros.scene.state import EGO_ID, Behavior
from simbev_ros.types import BoolArray, Float64Array, Int64Array, Table, UInt8Array
from simbev_ros.world.cast import Cast
from simbev_ros.world.kinematics.motion import Kinematics
from simbev_ros.world.lights import BEACON_HZ, BLINKER_HZ, blinks, vehicle_lights

_LARGEST_STEER_RAD = 0.7
_STEERING_RADPS = 1.5
_STEERING_MPS = 0.3


class ActorTable:
    """Fills one table for each tick; it remembers how far wheels and legs have turned."""

    def __init__(self, spec: SceneSpec, cast: Cast, vehicles: int) -> None:
        """For a cast whose first ``vehicles`` rows are vehicles."""
        self._cast = cast
        self._spec = spec
        self._tick_s = spec.tick_ns / NS_PER_S
        self._blink_cycles = np.array(
            [stream(spec.seed, f"vehicles.{row['id'] - EGO_ID}.blinker").random() for row in cast.rows[:vehicles]]
        )
        self._beacons = np.array([spec.vehicles[row["id"] - EGO_ID].emergency_lights for row in cast.rows[:vehicles]])
        # A rider pedals by the way of the bicycle below; vehicles' rows have the numbers of their leading points.
        self._moved_by = np.where(cast.rows["parent"] > 0, cast.bodies.point, np.arange(len(cast.rows)))
        self._steer_rad = np.zeros(len(cast.rows))
        self._wheel_rad = np.zeros(len(cast.rows))
        self._gait_rad = np.zeros(len(cast.rows))

    def at(self, motion: Kinematics, signals: Int64Array, doors: UInt8Array, jaywalking: BoolArray, step: int) -> Table:
        """(N,) ``ACTOR_DTYPE``, one step after the last one.

        Args:
            motion: Of the cast's rows.
            signals: (V,) SUMO's vehicle signals.
            doors: (V,) bits of open doors.
            jaywalking: (P,) who of the pedestrians crosses a street away from crosswalks.
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
        self._turn(motion)
        table["steer"], table["wheel"], table["gait"] = self._steer_rad, self._wheel_rad, self._gait_rad
        vehicles = slice(len(self._blink_cycles))
        weather = self._spec.weather_at(step - self._spec.warm_up_ticks)
        bright = blinks(self._blink_cycles, step * self._tick_s, BLINKER_HZ)
        beacons = self._beacons & blinks(self._blink_cycles, step * self._tick_s, BEACON_HZ)
        speed_mps, gain_mps2 = motion.speed_mps[vehicles], motion.gain_mps2[vehicles]
        table["lights"][vehicles] = vehicle_lights(signals, speed_mps, gain_mps2, bright, beacons, weather)
        table["doors"][vehicles] = doors
        table["behavior"][len(table) - len(jaywalking) :] |= (Behavior.JAYWALKING * jaywalking).astype(np.uint16)
        return table

    def _turn(self, motion: Kinematics) -> None:
        """Roll the wheels and move the legs over the way covered; steer as the turn demands (kinematic bicycle)."""
        cast = self._cast
        self._wheel_rad += motion.advance_m / cast.wheel_radius_m
        stride_m = cast.stride_m.copy()
        height_m = cast.rows["height"][cast.on_foot].astype(np.float64)
        stride_m[cast.on_foot] = strides_m(height_m, motion.speed_mps[cast.on_foot])
        turn_rad = 2.0 * np.pi * motion.advance_m[self._moved_by] / stride_m
        self._gait_rad = (self._gait_rad + turn_rad) % (2.0 * np.pi)
        rolls = motion.speed_mps > _STEERING_MPS
        steer_rad: Float64Array = np.arctan2(
            cast.wheelbase_m * motion.angular_velocity_radps[:, 2], np.where(rolls, motion.speed_mps, 1.0)
        )
        change_rad = np.clip(steer_rad, -_LARGEST_STEER_RAD, _LARGEST_STEER_RAD) - self._steer_rad
        most_rad = np.where(rolls, _STEERING_RADPS * self._tick_s, 0.0)  # who stands keeps the wheels as they are
        self._steer_rad += np.clip(change_rad, -most_rad, most_rad)
