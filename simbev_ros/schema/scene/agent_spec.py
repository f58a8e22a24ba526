"""Specification of an agent of a scene: its rig, and the vehicle or the roadside unit that carries it."""

from typing import Self

from pydantic import Field, model_validator

from simbev_ros.config.agents import EgoDriverKind
from simbev_ros.config.annotation import Annotation
from simbev_ros.config.base import Model
from simbev_ros.config.frames import DEFAULT_FRAMES, Frames
from simbev_ros.config.odometry import Odometry
from simbev_ros.config.rig import Rig

_WITHOUT_ODOM = Frames(odom=False)


class StationSpec(Model):
    """Pose of a roadside unit: the foot of its mast, map frame. The mast is upright and has no body."""

    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float


class AgentSpec(Model):
    """An agent of a scene. The ego is the first one, and the first vehicle carries it."""

    rig: Rig = Field(description="``rig.agent`` is the agent's name")
    frames: Frames = _WITHOUT_ODOM
    base_link_x_m: float = Field(
        0.0,
        ge=-20,
        le=20,
        description="x of the origin of base_link in the ego frame; readers need no catalog of vehicles for it",
    )
    annotation: Annotation
    vehicle: int | None = Field(None, ge=0, description="index in the scene's ``vehicles``; none: a roadside unit")
    driver: EgoDriverKind = "traffic"
    station: StationSpec | None = None

    @property
    def name(self) -> str:
        """Name of the agent, unique in its scene."""
        return self.rig.agent

    @model_validator(mode="after")
    def _one_carrier(self) -> Self:
        if (self.vehicle is None) == (self.station is None):
            raise ValueError(f"agent {self.name}: needs either a vehicle or a station")
        return self

    @model_validator(mode="after")
    def _wheels_exist(self) -> Self:
        has_odometry = (
            self.frames not in (DEFAULT_FRAMES, _WITHOUT_ODOM)
            or self.base_link_x_m != 0.0
            or bool(self.rig.of_type(Odometry))
        )
        if self.station is not None and (has_odometry or self.driver != "traffic"):
            raise ValueError(f"agent {self.name}: a roadside unit has neither wheels nor a driver")
        return self
