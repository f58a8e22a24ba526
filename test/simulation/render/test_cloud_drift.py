import numpy as np
import pytest

from simbev_ros.config.weather import WeatherParameters
from simbev_ros.scene.drawing.draw_weather import draw_weather
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.simulation.render.lighting.light import SkyLight

HOUR_NS = 3600 * 10**9


def weather(wind: float) -> Weather:
    return draw_weather(WeatherParameters(wind_intensity=wind), 1, even_fog=False)


def drift(wind: float, stamp_ns: int) -> float:
    """Displacement of the clouds as a fraction of their period."""
    now = weather(wind)
    return float(SkyLight.from_weather(now).block_head(now, stamp_ns, np.zeros(3), 1.0)[2, 3])


@pytest.mark.parametrize("number", [1, 300])
def test_clouds_do_not_race_when_the_wind_changes(number: int) -> None:
    start_ns = number * HOUR_NS + 4 * 10**9
    moved = [drift(5.0 * second, start_ns + second * 10**9) for second in range(17)]
    steps = np.abs((np.diff(moved) + 0.5) % 1.0 - 0.5)
    calm = abs(drift(100.0, start_ns + 10**9) - drift(100.0, start_ns))
    assert 0 < steps.max() < 2.5 * calm
