"""The rig: which sensors an agent carries."""

from collections.abc import Sequence
from typing import Annotated, Self, TypeVar

from pydantic import Field, model_validator

from simbev_ros.config.base import Model
from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.positioning import Gnss, Imu
from simbev_ros.config.radar import Radar
from simbev_ros.config.sensor import Name, Sensor

AnySensor = Annotated[Camera | Lidar | Radar | Gnss | Imu, Field(discriminator="type")]


S = TypeVar("S", bound=Sensor)


class Rig(Model):
    """The sensors of one agent."""

    agent: Name = Field("ego", description="first part of topics and frames")
    sensors: tuple[AnySensor, ...] = Field(description="told apart by `type`")

    @model_validator(mode="after")
    def _names_once(self) -> Self:
        names = [sensor.name for sensor in self.sensors]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"sensors: two sensors are named {', '.join(twice)}; names must be unique")
        return self

    def of_type(self, kind: type[S]) -> Sequence[S]:
        """The sensors of one type, in order."""
        return [sensor for sensor in self.sensors if isinstance(sensor, kind)]
