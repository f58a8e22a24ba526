"""Weather and light: the table of their parameters, and the section of the configuration that draws them.

``WeatherValues`` is the only place with a parameter's name, unit, limits and meaning. The configuration's section, the
weather of a scene, the index of datasets, figures, pages and documentation follow it; ``interfaces/msg/Weather.msg`` is
compared with it by a test, which prints the line to write. Docs: docs/extending/weather-parameter.md.
"""

import datetime
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, get_args

from annotated_types import BaseMetadata, Ge, GroupedMetadata, Le
from pydantic import BaseModel, ConfigDict, Field, create_model, model_validator

from simbev_ros.config.base import Model
from simbev_ros.config.draw import Drawn, PaperOrDrawn, within


@dataclass(frozen=True, slots=True)
class WeatherParameter(GroupedMetadata):
    """A row of the table of weather parameters.

    Attributes:
        unit: ``%``, ``°``, ``m``, or nothing.
        meaning: What it does.
        low: Minimum.
        high: Maximum; infinite: there is none.
        paper: The paper's rule, as ``simbev scene`` prints it: U uniform, B beta, N normal, LN log-normal. None: the
            paper does not know the parameter, and the configuration's default is that of the table.
        axis_high: Upper end of its axis in figures if there is no maximum.
        shelters: Whether it is 0 in a tunnel.
        curve: Color of its curve over time on a scene's page, 0xRRGGBB; None: it has no curve.
        typed: Whether Weather.msg has it. Bags with typed messages keep being readable while that message stays.
    """

    unit: str
    meaning: str
    low: float = 0.0
    high: float = math.inf
    paper: str | None = None
    axis_high: float = math.inf
    shelters: bool = False
    curve: int | None = None
    typed: bool = True

    def __iter__(self) -> Iterator[BaseMetadata]:
        """The limits, as pydantic checks them."""
        yield Ge(self.low)
        if math.isfinite(self.high):
            yield Le(self.high)

    @property
    def axis(self) -> tuple[float, float]:
        """Lower and upper end of its axis in figures."""
        return self.low, min(self.high, self.axis_high)


Season = Literal["spring", "summer", "autumn", "winter"]
SEASONS: tuple[Season, ...] = get_args(Season)

_RAIN = "B(0.8, 0.2)·cloudiness if cloudiness > 40, else 0"
_PUDDLES = "precipitation + B(1.2, 1.6)·(100 − precipitation)"
_WET = "film of water on surfaces, which darkens them and mirrors lamps; in rain also how many drops are on lenses"
_WET_RULE = "N(precipitation, 10) in 0 to 100"
_FOG = "100·B(1.6, 2.0) if cloudiness > 40 or sun below 10°, else 0"
_FALLOFF = "decrease of fog with height; 0: none, 1: about like air, above 5: close to the ground"
_FALLOFF_RULE = "5·B(1.2, 2.4), in Town12, 13, 15 and on high map files 0.01, if fog > 10, else 1"
_SNOW = "snow on ground, roofs and plants in images, and less grip in drives; lidars and radars do not change"
_SNOW_RULE = "U(40, 100) in 2 of 5 winter scenes without rain, else 0"
_LITTER, _LITTER_RULE = "fallen leaves on the ground in images", "U(20, 100) in autumn, U(0, 30) in winter, else 0"
_FLOWERS, _FLOWERS_RULE = "flowers in grass in images", "U(20, 100) in spring, else 0"
_AZIMUTH = "azimuth of the sun, counterclockwise from the map's x axis"
_ALTITUDE = "altitude of the sun above the horizon; negative at night"
_Row = WeatherParameter


class WeatherValues(BaseModel):
    """Value of every parameter at one moment, in CARLA's units; limits and rules are those of the SimBEV paper.

    Append rows at the end, with a default: scenes that were recorded before have this value.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    cloudiness: Annotated[float, _Row("%", "cloud cover", 0, 100, "100·B(0.8, 1.0)", curve=0x78828C)]
    precipitation: Annotated[float, _Row("%", "intensity of rain", 0, 100, _RAIN, shelters=True, curve=0x286EC8)]
    precipitation_deposits: Annotated[float, _Row("%", "area covered by puddles", 0, 100, _PUDDLES, shelters=True)]
    wetness: Annotated[float, _Row("%", _WET, 0, 100, _WET_RULE, shelters=True, curve=0x28A0A0)]
    wind_intensity: Annotated[float, _Row("%", "intensity of wind", 0, 100, "U(0, 100)")]
    sun_azimuth_deg: Annotated[float, _Row("°", _AZIMUTH, 0, 360, "U(0, 360)")]
    sun_altitude_deg: Annotated[float, _Row("°", _ALTITUDE, -90, 90, "180·B(3.6, 2.0) − 90", curve=0xE29628)]
    fog_density: Annotated[float, _Row("%", "density of fog", 0, 100, _FOG, shelters=True, curve=0xAA82BE)]
    fog_distance_m: Annotated[
        float, _Row("m", "distance at which fog starts", paper="LN(3.2, 0.8) if fog > 10, else 0", axis_high=100)
    ]
    fog_falloff: Annotated[float, _Row("", _FALLOFF, paper=_FALLOFF_RULE, axis_high=5)]
    snow_cover: Annotated[float, _Row("%", _SNOW, 0, 100, _SNOW_RULE, typed=False)] = 0.0
    leaf_litter: Annotated[float, _Row("%", _LITTER, 0, 100, _LITTER_RULE, typed=False)] = 0.0
    flowers: Annotated[float, _Row("%", _FLOWERS, 0, 100, _FLOWERS_RULE, typed=False)] = 0.0


def _rows() -> Iterator[tuple[str, WeatherParameter]]:
    for name, field in WeatherValues.model_fields.items():
        (row,) = (each for each in field.metadata if isinstance(each, WeatherParameter))
        yield name, row


WEATHER_PARAMETERS: Mapping[str, WeatherParameter] = MappingProxyType(dict(_rows()))
"""The rows of the table, by name."""


def message_field(name: str) -> str:
    """Field of ``simbev_interfaces/msg/Weather`` with a parameter; its angles are in radians."""
    return name.removesuffix("_deg").removesuffix("_m")


def _field(name: str, row: WeatherParameter) -> tuple[Any, Any]:
    """Type and default of a parameter in the configuration's section."""
    drawn, default = (Drawn, WeatherValues.model_fields[name].default) if row.paper is None else (PaperOrDrawn, "paper")
    return Annotated[drawn, within(row.low, row.high)], Field(default, description=row.meaning)


if TYPE_CHECKING:

    class WeatherFields(Model):
        """A model with fields that are only known when the program runs."""

else:
    WeatherFields = create_model(
        "WeatherFields",
        __base__=Model,
        __module__=__name__,
        __doc__="The parameters, each with a field.",
        **{name: _field(name, row) for name, row in WEATHER_PARAMETERS.items()},
    )


class Sun(Model):
    """Date, place and time of day, from which the direction of the sun follows."""

    date: datetime.date = Field(description="date, such as 2026-06-21")
    hour: Annotated[Drawn, within(0, 24)] = Field(description="local solar time, h; at 12 the sun is highest")
    latitude_deg: float | None = Field(
        None, ge=-90, le=90, description="latitude, north positive; none: that of the map, 0 if it has no georeference"
    )


class WeatherParameters(WeatherFields):
    """Weather and light; ``paper`` draws by the rules of the paper's table, some of which depend on others.

    With ``precipitation: 0``, ``wetness`` and ``precipitation_deposits`` are 0 unless they are given.
    """

    sun: Sun | None = Field(
        None, description="date and time in place of `sun_azimuth_deg` and `sun_altitude_deg`; none: these two"
    )

    @model_validator(mode="before")
    @classmethod
    def _dry_without_rain(cls, data: Any) -> Any:
        if isinstance(data, dict) and data.get("precipitation") == 0:
            return {"wetness": 0.0, "precipitation_deposits": 0.0, **data}
        return data

    @model_validator(mode="after")
    def _one_sun(self) -> Self:
        given = [name for name in ("sun_azimuth_deg", "sun_altitude_deg") if getattr(self, name) != "paper"]
        if self.sun is not None and given:
            raise ValueError(f"sun and {given[0]} are set; give one of them")
        return self


class WeatherConfig(WeatherParameters):
    """Season, and weather and light at the scene's start and, if they change, at its end.

    Of CARLA's parameters, four have no counterpart. ``scattering_intensity``: fog has the color of the sky and the sun,
    and lamps do not light it. ``mie_scattering_scale`` and ``rayleigh_scattering_scale``: the sky is computed for one
    clear atmosphere. ``dust_storm``: CARLA gives neither a visibility nor a color for its percentages.
    """

    season: Season | None = Field(
        None,
        description="season of plants and ground; none: that of `sun.date`, and without a date each is equally likely",
    )
    final: WeatherParameters | None = Field(
        None,
        description="weather at the last tick, reached linearly from the first; parameters not given are `paper`, "
        "but snow, leaves and flowers stay",
    )
