"""Exposure of a camera's color image: brightness relative to automatic exposure, from the camera's settings."""

import math
from dataclasses import dataclass

from simbev_ros.config.optics import Exposure, Shutter
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.simulation.render.lighting.light import SkyLight, light_of_exposure

_SUNNY_EV = 14.64
"""Exposure value of f/16, 1/100 s, ISO 100: correct for sunlit scenes by the "sunny 16" rule of photography."""
_SUNNY_EXPOSURE = 0.8
"""Automatic exposure factor of equal brightness (sky.yaml, sun at 30° to 90°)."""
_NOON_LUX, _LAMPS_LUX = 1.2e5, 15.0
"""Illuminance outside the atmosphere, nearly, and on streets and in tunnels with lamps (EN 13201-2, class C3)."""
_INCIDENT_LUX = 2.5
"""Illuminance for which f/1, 1 s, ISO 100 is correct: the calibration constant of incident light meters (ISO 2720)."""


@dataclass(frozen=True, slots=True)
class ShutterTimes:
    """When the rows of an image are exposed.

    Attributes:
        exposure_s: Exposure time of each row.
        readout_s: Time from the first row to the last; 0: global shutter.
        amplification: Factor on signals and noise, as a share of electrons; below 1 the wells are not filled.
    """

    exposure_s: float
    readout_s: float
    amplification: float


def shutter_times(exposure: Exposure, shutter: Shutter, weather: Weather, adaptation: float = 1.0) -> ShutterTimes:
    """Times of a camera's shutter: fixed ones, or by the light of the scene, as its real counterpart has it.

    Args:
        exposure: Settings of the camera.
        shutter: Its shutter.
        weather: Weather and light.
        adaptation: As in ``exposure_gain``.
    """
    if exposure.time_s is not None and exposure.iso is not None:
        return ShutterTimes(exposure.time_s, shutter.readout_s, exposure.iso / shutter.iso)
    noon = light_of_exposure(SkyLight.from_weather(weather).exposure * adaptation)
    lux = max(_NOON_LUX * noon, _LAMPS_LUX)
    wanted_s = exposure.f_number**2 * _INCIDENT_LUX / lux * 100.0 / shutter.iso
    wanted_s *= math.exp2(exposure.compensation_ev)
    time_s = min(wanted_s, shutter.max_time_s)
    return ShutterTimes(time_s, shutter.readout_s, wanted_s / time_s)


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
