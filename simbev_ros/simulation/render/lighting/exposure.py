"""Exposure of a camera's color image: brightness relative to automatic exposure, from the camera's settings."""

import math

from simbev_ros.config.optics import Exposure
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.simulation.render.lighting.light import SkyLight

_SUNNY_EV = 14.64
"""Exposure value of f/16, 1/100 s, ISO 100: correct for sunlit scenes by the "sunny 16" rule of photography."""
_SUNNY_EXPOSURE = 0.8
"""Automatic exposure factor of equal brightness (sky.yaml, sun at 30° to 90°)."""


def exposure_gain(exposure: Exposure, weather: Weather, adaptation: float = 1.0) -> float:
    """Brightness of an image relative to automatic exposure, as a factor before tone mapping.

    The simulated night is brighter than a real one, so a fixed exposure shows more of it.

    Args:
        exposure: Settings of the camera.
        weather: Weather and light.
        adaptation: Factor by which automatic exposure differs from that of the weather, as in tunnels.
    """
    gain = math.exp2(exposure.compensation_ev)
    value_ev = exposure.value_ev
    if value_ev is None:
        return gain
    automatic = SkyLight.from_weather(weather).exposure * adaptation
    return gain * _SUNNY_EXPOSURE * math.exp2(_SUNNY_EV - value_ev) / automatic
