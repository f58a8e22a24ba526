"""Traffic lights, traffic signs and weather of a tick as OSI has them.

Rows of /world/signals and /ego/boxes and a weather enter; messages leave. Each bulb of a light's head is a message of
its own. Signs are those that have boxes at the tick.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from osi3.osi_common_pb2 import ExternalReference
from osi3.osi_environment_pb2 import EnvironmentalConditions
from osi3.osi_trafficlight_pb2 import TrafficLight
from osi3.osi_trafficsign_pb2 import TrafficSign, TrafficSignValue

from simbev_exporters.osi.objects import base_stationary, osi_names
from simbev_ros.foundation.semantics import SIGN_TYPES
from simbev_ros.foundation.types import Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.scene.air import extinction_per_m
from simbev_ros.schema.scene.state import SignalState
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.simulation.sensors.radar_amplitude import rain_rate_mmph

BULB_IDS = 1 << 18
"""Offset of the ids of bulbs, above those of boxes: three for each head, from above."""

_EYE_HEIGHT_M = 1.5
_LEFT_OF_LIGHT = 0.05
"""Share of the light that is left at the range of visibility (Meteorological Office)."""
_KMPH_PER_MPS = 3.6
_STATES = {int(state): state.name for state in SignalState}


def traffic_lights(signals: Table, opendrive_ids: Sequence[str | None]) -> list[TrafficLight]:
    """Bulbs of (S,) ``SIGNAL_DTYPE`` heads; ids of the heads in the map's OpenDRIVE file are references."""
    kinds, names = TrafficLight.Classification, osi_names()
    found = []
    for row, opendrive_id in zip(signals, opendrive_ids, strict=True):
        state = _STATES.get(int(row["state"]), "OFF")
        for number, bulb in enumerate(names["bulbs"]):
            center_m = np.array([row["x"], row["y"], row["z"] + bulb["z_m"]])
            light = TrafficLight(base=base_stationary(center_m, names["bulb_size_m"], (0.0, 0.0, float(row["yaw"]))))
            light.id.value = BULB_IDS + len(names["bulbs"]) * int(row["id"]) + number
            light.classification.color = getattr(kinds, f"COLOR_{bulb['color']}")
            light.classification.icon = kinds.ICON_NONE
            light.classification.mode = kinds.MODE_CONSTANT if state in bulb["lit"] else kinds.MODE_OFF
            if opendrive_id:
                reference = ExternalReference(type="net.asam.opendrive", identifier=[opendrive_id])
                light.source_reference.append(reference)
            found.append(light)
    return found


def traffic_signs(boxes: Table) -> list[TrafficSign]:
    """Signs among (N,) ``BOX_DTYPE`` boxes."""
    known, found = osi_names()["signs"], []
    kinds = TrafficSign.MainSign.Classification
    for row in boxes[boxes["sign"] > 0]:
        sign_type, *unit = known[SIGN_TYPES[row["sign"]]]
        size_m = [float(row[size]) for size in ("length", "width", "height")]
        angles = [float(row[angle]) for angle in ("roll", "pitch", "yaw")]
        center_m = np.array([row["x"], row["y"], row["z"]])
        sign = TrafficSign()
        sign.id.value = int(row["id"])
        sign.main_sign.base.CopyFrom(base_stationary(center_m, size_m, angles))
        sign.main_sign.classification.type = getattr(kinds, sign_type)
        sign.main_sign.classification.variability = TrafficSign.VARIABILITY_FIXED
        if unit:
            sign.main_sign.classification.value.value = float(row["limit"]) * _KMPH_PER_MPS
            sign.main_sign.classification.value.value_unit = getattr(TrafficSignValue, unit[0])
        found.append(sign)
    return found


def environment(weather: Weather, stamp_ns: int) -> EnvironmentalConditions:
    """Weather and light at a stamp. Illumination is that under a clear sky, by the sun's altitude."""
    kinds, names = EnvironmentalConditions, osi_names()
    fog_per_m, rain_per_m = extinction_per_m(weather, _EYE_HEIGHT_M)
    visibility_m = -np.log(_LEFT_OF_LIGHT) / max(fog_per_m + rain_per_m, 1e-9)
    light = _level(names["sun_altitude_deg"], weather.sun_altitude_deg)
    rain = _level(names["rain_mmph"], rain_rate_mmph(weather))
    conditions = EnvironmentalConditions(
        ambient_illumination=getattr(kinds, f"AMBIENT_ILLUMINATION_{light}"),
        precipitation=getattr(kinds, f"PRECIPITATION_{rain}"),
        fog=getattr(kinds, f"FOG_{_level(names['visibility_m'], visibility_m)}"),
        unix_timestamp=stamp_ns // NS_PER_S,
    )
    oktas = ("ZERO", "ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX", "SEVEN", "EIGHT")[round(weather.cloudiness / 12.5)]
    covers = EnvironmentalConditions.CloudLayer
    conditions.clouds.fractional_cloud_cover = getattr(covers, f"FRACTIONAL_CLOUD_COVER_{oktas}_OKTAS")
    conditions.sun.elevation = float(np.radians(weather.sun_altitude_deg))
    return conditions


def _level(limits: Mapping[str, float], value: float) -> str:
    """The last name whose lower limit a value has reached."""
    return [name for name, limit in limits.items() if value >= limit][-1]
