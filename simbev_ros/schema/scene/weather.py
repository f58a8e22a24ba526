"""Weather and sun of one moment."""

import numpy as np

from simbev_ros.config.weather import WEATHER_PARAMETERS, WeatherValues

_AZIMUTH = list(WEATHER_PARAMETERS).index("sun_azimuth_deg")
_LOW_SUN_DEG = 5.0
_HEAVY_RAIN = 50.0
_THICK_FOG = 40.0


class Weather(WeatherValues):
    """Fully drawn weather; ``config.weather`` has the table of its parameters."""

    @property
    def needs_low_beam(self) -> bool:
        """Whether drivers switch their lights on everywhere: at dusk and night, in heavy rain, in thick fog."""
        return self.sun_altitude_deg < _LOW_SUN_DEG or self.precipitation > _HEAVY_RAIN or self.fog_density > _THICK_FOG

    def sheltered(self) -> "Weather":
        """The weather without rain, fog and wet ground, as it is in a tunnel."""
        return self.model_copy(update={name: 0.0 for name, row in WEATHER_PARAMETERS.items() if row.shelters})

    def interpolate(self, other: "Weather", fraction: float) -> "Weather":
        """Weather at a fraction, 0 to 1, of a linear transition; the sun's azimuth takes the shorter way around."""
        start, end = (np.array(list(each.model_dump().values())) for each in (self, other))
        end[_AZIMUTH] = start[_AZIMUTH] + (end[_AZIMUTH] - start[_AZIMUTH] + 180.0) % 360.0 - 180.0
        # Clipped, because rounding may exceed the range in the last digit.
        now = np.clip(start * (1.0 - fraction) + end * fraction, np.minimum(start, end), np.maximum(start, end))
        now[_AZIMUTH] %= 360.0
        return Weather(**dict(zip(WEATHER_PARAMETERS, now.tolist(), strict=True)))
