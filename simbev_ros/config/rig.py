"""The rig: which sensors an agent carries."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Final, Self, TypeVar, get_args

from pydantic import Field, model_validator

from simbev_ros.config.base import Model
from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.positioning import Gnss, Imu
from simbev_ros.config.radar import Radar
from simbev_ros.config.sensor import Name, Sensor

AnySensor = Annotated[Camera | Lidar | Radar | Gnss | Imu, Field(discriminator="type")]
"""Every kind of sensor. Code that depends on the kind follows from this union or is checked against it.

How to add a kind: docs/extending/sensor.md.
"""

S = TypeVar("S", bound=Sensor)


def _models_by_kind() -> dict[str, type[Sensor]]:
    union, *_ = get_args(AnySensor)
    return {get_args(model.model_fields["type"].annotation)[0]: model for model in get_args(union)}


SENSOR_KINDS: Final[Mapping[str, type[Sensor]]] = _models_by_kind()
"""Model of each kind of sensor by the kind's name, which is the ``type`` in a rig; in the order of the union."""


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
