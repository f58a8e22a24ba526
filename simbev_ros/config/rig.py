"""The rig: the sensors that an agent carries, and the registry of sensor kinds."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Final, Self, TypeVar, get_args

from pydantic import Field, model_validator

from simbev_ros.config.base import Model
from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.names import TopicName
from simbev_ros.config.odometry import Odometry
from simbev_ros.config.positioning import Gnss, Imu
from simbev_ros.config.radar import Radar
from simbev_ros.config.sensor import Sensor

AnySensor = Annotated[Camera | Lidar | Radar | Gnss | Imu | Odometry, Field(discriminator="type")]
"""Union of all kinds of sensors. Code that depends on the kind is derived from this union or checked against it.

How to add a kind: docs/extending/sensor.md.
"""

S = TypeVar("S", bound=Sensor)


def _models_by_kind() -> dict[str, type[Sensor]]:
    union, *_ = get_args(AnySensor)
    return {get_args(model.model_fields["type"].annotation)[0]: model for model in get_args(union)}


SENSOR_KINDS: Final[Mapping[str, type[Sensor]]] = _models_by_kind()
"""Model of each kind of sensor by the kind's name, the ``type`` in a rig, in the order of the union."""


class Rig(Model):
    """The sensors of one agent."""

    agent: TopicName = Field("ego", description="name of the agent, the first part of its topics and frames")
    sensors: tuple[AnySensor, ...] = Field(description="list of sensors; `type` selects the kind")

    @model_validator(mode="after")
    def _names_once(self) -> Self:
        names = [sensor.name for sensor in self.sensors]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"sensors: two sensors are named {', '.join(twice)}; names must be unique")
        return self

    def of_type(self, kind: type[S]) -> Sequence[S]:
        """Sensors of one type, in order."""
        return [sensor for sensor in self.sensors if isinstance(sensor, kind)]
