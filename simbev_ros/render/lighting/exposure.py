"""How bright a camera's colour image is, from its settings."""

import math

from simbev_ros.config.optics import Exposure
from simbev_ros.render.lighting.light import SkyLight
from simbev_ros.scene.weather import Weather

_SUNNY_EV = 14.64
"""Exposure value of f/16, 1/100 s, ISO 100: right for what the sun shines on, by an old rule of photographers."""
_SUNNY_EXPOSURE = 0.8
"""The factor before tone mapping that is as bright (sky.yaml, the sun at 30° to 90°)."""


def exposure_gain(exposure: Exposure, weather: Weather) -> float:
    """How much brighter than with the automatic exposure an image is: a factor before tone mapping.

    The light of the night is not as weak as in truth, so a fixed exposure shows more of it.
    """
    gain = math.exp2(exposure.compensation_ev)
    value_ev = exposure.value_ev
    if value_ev is None:
        return gain
    return gain * _SUNNY_EXPOSURE * math.exp2(_SUNNY_EV - value_ev) / SkyLight.of(weather).exposure
