"""Vehicle model: steering angle and acceleration demanded in, planar motion out.

A dynamic bicycle model (Rajamani, "Vehicle Dynamics and Control", 2nd ed., 2012, sections 2.3 and 4.2). Each axle has
lateral forces by Pacejka's formula, ``D sin(C atan(B alpha))``, whose initial slope is the cornering stiffness and
whose peak D is what friction leaves beside the longitudinal force (friction ellipse). Axle loads shift with
acceleration. Drive and brakes follow their demand with a lag of first order, within power, brakes and friction; drag,
rolling resistance and slope act on the vehicle. Slip angles are undefined at rest, so the kinematic bicycle model takes
over linearly from ``BLEND_MPS[1]`` down to ``BLEND_MPS[0]`` and in reverse.
"""

import math
from dataclasses import dataclass
from functools import cache
from typing import Any, Self

from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.units import GRAVITY_MPS2
from simbev_ros.scene.blueprints import Blueprint
from simbev_ros.schema.scene.weather import Weather

BLEND_MPS = 1.0, 3.0
_STEP_S = 0.0025
"""Longest step of the integration: the fastest mode, lateral at ``BLEND_MPS[1]``, has a time constant of 20 ms."""
_AIR_KGPM3 = 1.204
_MIN_LOAD = 0.05
"""Share of its load at rest that an axle keeps: there is no tire without load."""
_WET_FRICTION, _PUDDLE_FRICTION = 0.7, 0.55
"""Friction by that of a dry road: wet asphalt, and water at city speeds (Wallman and Åström, VTI 911A, 2001)."""
_SNOW_FRICTION = 0.25
"""Likewise on moderate snow, between 0.31 on light and 0.19 on heavy snow ("Lateral coefficient of friction for
characterizing winter road conditions", University of Alberta, tests of 2012/13)."""


def road_friction(weather: Weather, *, with_snow: bool) -> float:
    """Mean friction of the road by that of a dry one: falls with wetness, further with puddles, most under snow."""
    wetness, puddles = weather.wetness / 100.0, weather.precipitation_deposits / 100.0
    wet = 1.0 - (1.0 - _WET_FRICTION) * max(wetness, puddles)
    wet -= (_WET_FRICTION - _PUDDLE_FRICTION) * puddles
    return wet + (_SNOW_FRICTION - wet) * with_snow * weather.snow_cover / 100.0


@dataclass(frozen=True, slots=True)
class Dynamics:
    """Parameters of a vehicle; see vehicle_dynamics.yaml.

    Attributes:
        mass_kg: Mass.
        inertia_kgm2: Moment of inertia about the vertical axis.
        front_m: Distance from the center of gravity forward to the front axle.
        rear_m: Distance from it back to the rear axle.
        height_m: Height of the center of gravity.
        cornering: Cornering stiffness of the front and the rear axle by their loads, 1/rad.
        peak: Friction on a dry road.
        shape: C of Pacejka's formula.
        drag_m2: Drag coefficient times frontal area.
    """

    mass_kg: float
    inertia_kgm2: float
    front_m: float
    rear_m: float
    height_m: float
    cornering: tuple[float, float]
    peak: float
    shape: float
    drag_m2: float
    rolling: float
    drive_lag_s: float
    brake_lag_s: float
    power_w: float
    max_drive_mps2: float
    max_brake_mps2: float
    max_steer_rad: float
    steer_rate_radps: float

    @classmethod
    def of(cls, blueprint: Blueprint) -> Self:
        """The parameters of a blueprint, which has a row in the table, or else its class has."""
        row = _table()[blueprint.name if blueprint.name in _table() else blueprint.sumo_class]
        length_m, width_m, height_m = blueprint.size_m
        wheelbase_m, mass_kg = blueprint.wheelbase_m, row["density"] * length_m * width_m * height_m
        front_m, rear_m = (1.0 - row["front_load"]) * wheelbase_m, row["front_load"] * wheelbase_m
        same = ("peak", "shape", "rolling", "drive_lag_s", "brake_lag_s", "max_steer_rad", "steer_rate_radps")
        return cls(
            mass_kg=mass_kg,
            inertia_kgm2=mass_kg * row["yaw_radius"] ** 2 * front_m * rear_m,
            front_m=front_m,
            rear_m=rear_m,
            height_m=row["cog_height"] * height_m,
            cornering=tuple(row["cornering"]),
            drag_m2=row["drag"] * row["area"] * width_m * height_m,
            power_w=row["power_w_per_kg"] * mass_kg,
            max_drive_mps2=1.5 * blueprint.accel,  # accel is the comfortable value
            max_brake_mps2=row["full_brake"] * GRAVITY_MPS2,
            **{name: row[name] for name in same},
        )

    @property
    def wheelbase_m(self) -> float:
        """Distance between the axles."""
        return self.front_m + self.rear_m

    @property
    def understeer_s2pm(self) -> float:
        """Understeer gradient: steering angle beyond Ackermann's by lateral acceleration, rad s²/m (Rajamani 3.3)."""
        return (1.0 / self.cornering[0] - 1.0 / self.cornering[1]) / GRAVITY_MPS2

    def resistance_mps2(self, speed_mps: float, slope: float) -> float:
        """Deceleration by drag, rolling resistance and a slope (rise by run, ahead), without drive and brakes."""
        drag = 0.5 * _AIR_KGPM3 * self.drag_m2 * speed_mps * abs(speed_mps) / self.mass_kg
        down, along = (each / math.hypot(1.0, slope) for each in (1.0, slope))
        rolling = math.copysign(self.rolling * min(abs(speed_mps), 1.0), speed_mps) * down  # fades at rest
        return drag + GRAVITY_MPS2 * (rolling + along)


@cache
def _table() -> dict[str, dict[str, Any]]:
    rows: dict[str, dict[str, Any]] = load_table("simbev_ros.simulation.world.driving", "vehicle_dynamics.yaml")
    return rows


@dataclass(slots=True)
class VehicleModel:
    """A vehicle on a plane; the position is that of its center of gravity.

    Attributes:
        dynamics: Its parameters.
        x_m: Position, map frame.
        y_m: Position, map frame.
        yaw_rad: Heading.
        speed_mps: Velocity along the vehicle, negative in reverse.
        left_mps: Velocity to its left at the center of gravity.
        yaw_rate_radps: Yaw rate.
        steer_rad: Angle of the front wheels.
        drive_mps2: Acceleration by drive (positive) or brakes (negative) at the wheels, which lags behind its demand.
    """

    dynamics: Dynamics
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    speed_mps: float = 0.0
    left_mps: float = 0.0
    yaw_rate_radps: float = 0.0
    steer_rad: float = 0.0
    drive_mps2: float = 0.0

    def advance(
        self,
        duration_s: float,
        steer_rad: float,
        drive_mps2: float,
        friction: float = 1.0,
        slope: float = 0.0,
        *,
        reverse: bool = False,
    ) -> None:
        """Drive for a duration.

        Args:
            duration_s: Duration, which is divided into steps.
            steer_rad: Angle of the front wheels demanded, left positive.
            drive_mps2: Acceleration demanded at the wheels in the direction of the gear; a negative one brakes whatever
                the direction of motion is, and holds at rest.
            friction: Friction of the road by that of a dry one.
            slope: Rise of the road ahead by its run.
            reverse: Whether the gear is that for reverse.
        """
        steps = math.ceil(duration_s / _STEP_S - 1e-9)
        for _ in range(steps):
            self._step(duration_s / steps, steer_rad, drive_mps2, friction, slope, -1.0 if reverse else 1.0)

    def _step(
        self, step_s: float, steer_rad: float, demand_mps2: float, friction: float, slope: float, gear: float
    ) -> None:
        own = self.dynamics
        target_rad = clamp(steer_rad, own.max_steer_rad)
        self.steer_rad += clamp(target_rad - self.steer_rad, own.steer_rate_radps * step_s)
        lag_s = own.brake_lag_s if demand_mps2 < 0.0 else own.drive_lag_s
        demand_mps2 = min(max(demand_mps2, -own.max_brake_mps2), self._max_drive_mps2())
        self.drive_mps2 += (demand_mps2 - self.drive_mps2) * (1.0 - math.exp(-step_s / lag_s))
        brakes, before_mps = self.drive_mps2 < 0.0, self.speed_mps
        grip_mps2 = friction * own.peak * GRAVITY_MPS2 / math.hypot(1.0, slope)
        direction = math.copysign(1.0, before_mps) if brakes and before_mps else gear
        wheels_mps2 = direction * clamp(self.drive_mps2, grip_mps2)
        along_mps2 = wheels_mps2 - own.resistance_mps2(before_mps, slope)
        side_mps2, turn_radps2, bend_mps2 = self._lateral(along_mps2, wheels_mps2, friction)
        along_mps2 -= bend_mps2
        self.speed_mps += (along_mps2 + self._dynamic_share * self.left_mps * self.yaw_rate_radps) * step_s
        if brakes and before_mps * self.speed_mps <= 0.0:
            self.speed_mps = 0.0
        self.left_mps += (side_mps2 - before_mps * self.yaw_rate_radps) * step_s
        self.yaw_rate_radps += turn_radps2 * step_s
        self._blend_with_kinematic()
        self.yaw_rad += self.yaw_rate_radps * step_s
        cosine, sine = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        mean_mps = (before_mps + self.speed_mps) / 2.0
        self.x_m += (mean_mps * cosine - self.left_mps * sine) * step_s
        self.y_m += (mean_mps * sine + self.left_mps * cosine) * step_s

    def _max_drive_mps2(self) -> float:
        own = self.dynamics
        return min(own.max_drive_mps2, own.power_w / own.mass_kg / max(abs(self.speed_mps), 0.1))

    def _lateral(self, along_mps2: float, wheels_mps2: float, friction: float) -> tuple[float, float, float]:
        """Lateral acceleration by the tires, yaw acceleration, and deceleration by the steered front tires."""
        own, forward_mps = self.dynamics, max(self.speed_mps, BLEND_MPS[0])
        shift = along_mps2 * own.height_m / (GRAVITY_MPS2 * own.wheelbase_m)
        shares = own.rear_m / own.wheelbase_m - shift, own.front_m / own.wheelbase_m + shift
        slips_rad = (
            self.steer_rad - math.atan2(self.left_mps + own.front_m * self.yaw_rate_radps, forward_mps),
            -math.atan2(self.left_mps - own.rear_m * self.yaw_rate_radps, forward_mps),
        )
        # Forces by mass; drive and brakes act on both axles in proportion to their loads.
        peak = friction * own.peak
        used = min(abs(wheels_mps2) / (peak * GRAVITY_MPS2), 1.0)
        left = peak * math.sqrt(max(1.0 - used**2, 1e-4))
        forces_mps2 = []
        for share, slip_rad, stiffness in zip(shares, slips_rad, own.cornering, strict=True):
            angle = stiffness * slip_rad / (own.shape * left)
            force = left * math.sin(own.shape * math.atan(angle))
            forces_mps2.append(max(share, _MIN_LOAD) * GRAVITY_MPS2 * force)
        front_mps2, rear_mps2 = forces_mps2[0] * math.cos(self.steer_rad), forces_mps2[1]
        turn_radps2 = (own.front_m * front_mps2 - own.rear_m * rear_mps2) * own.mass_kg / own.inertia_kgm2
        share = self._dynamic_share  # in the kinematic model, wheels roll without force
        return front_mps2 + rear_mps2, turn_radps2, share * forces_mps2[0] * math.sin(self.steer_rad)

    @property
    def _dynamic_share(self) -> float:
        """Share of the dynamic model at this speed; the rest is that of the kinematic one."""
        return min(max((self.speed_mps - BLEND_MPS[0]) / (BLEND_MPS[1] - BLEND_MPS[0]), 0.0), 1.0)

    def _blend_with_kinematic(self) -> None:
        """At low speeds, take lateral velocity and yaw rate from the kinematic model, in which no tire slips."""
        share = self._dynamic_share
        if share < 1.0:
            yaw_rate_radps = self.speed_mps * math.tan(self.steer_rad) / self.dynamics.wheelbase_m
            self.yaw_rate_radps = share * self.yaw_rate_radps + (1.0 - share) * yaw_rate_radps
            self.left_mps = share * self.left_mps + (1.0 - share) * yaw_rate_radps * self.dynamics.rear_m


def clamp(value: float, limit: float) -> float:
    """The value, limited to ``limit`` in magnitude."""
    return min(max(value, -limit), limit)
