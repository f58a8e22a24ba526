"""Roads made up by hand, and weather that changes nothing on them."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.schema.scene.weather import Weather


def made_up_lane(
    name: str, *successors: str, length_m: float = 100.0, line_m: ArrayLike | None = None, **changes: Any
) -> Lane:
    """A driving lane of 50 km/h outside junctions, along the x axis or a line; edge and index are those in its name."""
    edge, _, index = name.rpartition("_")
    points_m = np.array([[0.0, 0.0, 0.0], [length_m, 0.0, 0.0]] if line_m is None else line_m, np.float64)
    return replace(Lane(name, edge, int(index), LaneKind.DRIVING, points_m, 3.5, 13.9, "", successors), **changes)


def made_up_sidewalk(name: str, *successors: str, **changes: Any) -> Lane:
    """A lane for pedestrians."""
    return made_up_lane(name, *successors, **{"kind": LaneKind.SIDEWALK, "width_m": 2.0, "speed_mps": 2.0, **changes})


def network_of(base: RoadNetwork, *lanes: Lane) -> RoadNetwork:
    """A map with only these lanes, and all else of another one."""
    return replace(base, lanes={each.id: each for each in lanes})


def clear_weather(**changes: float) -> Weather:
    """A dry, cloudless day without wind or fog; the sun is in the north, 60° high."""
    still = dict.fromkeys(("precipitation", "precipitation_deposits", "wetness", "wind_intensity", "cloudiness"), 0.0)
    sky = {"sun_azimuth_deg": 0.0, "sun_altitude_deg": 60.0, "fog_density": 0.0, "fog_distance_m": 0.0}
    return Weather.model_validate({**still, **sky, "fog_falloff": 1.0, **changes})
