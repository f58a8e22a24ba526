"""The rig: the sensors that an agent carries, and the registry of sensor kinds."""

from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Annotated, Any, Final, Self, TypeVar, get_args

from pydantic import Field, SerializerFunctionWrapHandler, TypeAdapter, model_serializer, model_validator

from simbev_ros.config.base import FieldError, Model, first_problem
from simbev_ros.config.camera import Camera
from simbev_ros.config.draw import DrawnOrChosen, Options
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


_NOT_DRAWN = ("name", "type", "rate_hz", "modalities", "points", "semantic_points", "scan", "video")
"""Fields that decide which topics a rig has and when they come, which is the same in all scenes."""
_SENSOR: Final[TypeAdapter[AnySensor]] = TypeAdapter(AnySensor)


class Rig(Model):
    """The sensors of one agent."""

    agent: TopicName = Field("ego", description="name of the agent, the first part of its topics and frames")
    sensors: tuple[AnySensor, ...] = Field(description="list of sensors; `type` selects the kind")
    drawn: dict[str, dict[str, DrawnOrChosen]] = Field(
        {},
        description="values that are drawn for each scene: by the name of a sensor, or a pattern such as `cam_*` whose "
        "sensors share each draw, and by field, such as `preset` or `pose.z_m`",
    )

    @model_validator(mode="after")
    def _names_once(self) -> Self:
        names = [sensor.name for sensor in self.sensors]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"sensors: two sensors are named {', '.join(twice)}; names must be unique")
        return self

    @model_validator(mode="after")
    def _draws_are_valid(self) -> Self:
        for pattern, fields in self.drawn.items():
            if not (drawn := [sensor for sensor in self.sensors if fnmatchcase(sensor.name, pattern)]):
                names = ", ".join(sensor.name for sensor in self.sensors)
                raise FieldError(["drawn", pattern], f"matches no sensor; names are {names}")
            for sensor in drawn:
                self._require_valid_draws(pattern, fields, sensor)
        return self

    def _require_valid_draws(self, pattern: str, fields: Mapping[str, DrawnOrChosen], sensor: Sensor) -> None:
        for name in fields:
            if name.partition(".")[0] in _NOT_DRAWN:
                raise FieldError(["drawn", pattern, name], "decides which topics there are, which cannot be drawn")
        if "preset" in fields:
            if "preset" in sensor.model_fields_set:
                raise FieldError(["drawn", pattern, "preset"], f"sensor {sensor.name} has a fixed one, too")
            if sensor.rate_hz is None:
                raise FieldError(["drawn", pattern, "preset"], f"sensor {sensor.name} needs a rate_hz of its own")
        first = {name: next(_extremes(values)) for name, values in fields.items()}
        for name, values in fields.items():
            for value in _extremes(values):
                try:
                    _with_values(sensor, {**first, name: value})
                except ValueError as error:
                    problem = f"draws {value!r} for sensor {sensor.name}: {first_problem(error)}"
                    raise FieldError(["drawn", pattern, name], problem) from None

    @model_serializer(mode="wrap")
    def _as_given(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Without values that sensors were not given, where some are drawn: a preset would not replace them."""
        values: dict[str, Any] = handler(self)
        if not self.drawn:
            del values["drawn"]
            return values
        return {**values, "sensors": [sensor.model_dump(mode="json", exclude_unset=True) for sensor in self.sensors]}

    def of_type(self, kind: type[S]) -> Sequence[S]:
        """Sensors of one type, in order."""
        return [sensor for sensor in self.sensors if isinstance(sensor, kind)]

    def with_values(self, values: Mapping[str, Mapping[str, float | str]]) -> "Rig":
        """The rig of a scene: values in place of what is ``drawn``, by its patterns and fields.

        Raises:
            ValueError: A sensor cannot have such values together.
        """
        sensors = []
        for sensor in self.sensors:
            own = {
                name: value
                for pattern, fields in values.items()
                if fnmatchcase(sensor.name, pattern)
                for name, value in fields.items()
            }
            sensors.append(_with_values(sensor, own) if own else sensor)
        return Rig(agent=self.agent, sensors=tuple(sensors))

    @property
    def extremes(self) -> tuple["Rig", ...]:
        """The rigs with the smallest and with the largest of all drawn values; without draws, the rig itself."""
        if not self.drawn:
            return (self,)
        ends = [
            {pattern: {name: list(_extremes(fields[name]))[end] for name in fields} for pattern, fields in rows}
            for end in (0, -1)
            for rows in [self.drawn.items()]
        ]
        return tuple(map(self.with_values, ends))


def _extremes(values: DrawnOrChosen) -> Iterator[float | str]:
    """All values that can be drawn, or the smallest and the largest."""
    if isinstance(values, Options):
        yield from values.choice
    else:
        yield from values.support if values.choice is None else sorted(values.choice)


def _with_values(sensor: Sensor, values: Mapping[str, float | str]) -> AnySensor:
    """Copy of a sensor with other values, which ``pose.z_m`` and the like name."""
    data = sensor.model_dump(mode="json", exclude_unset=True)
    for name, value in values.items():
        *sections, field = name.split(".")
        section = data
        for key in sections:
            section = section.setdefault(key, {})
        section[field] = value
    return _SENSOR.validate_python(data)
