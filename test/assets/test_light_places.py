"""Street lights keep their spacing from one region to the next."""

from types import SimpleNamespace

import numpy as np
import pytest

from simbev_ros.assets.street.curbs import STATION_M, CurbLine
from simbev_ros.assets.street.light_places import Lanes, light_positions
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.region import REGION_M, Region
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.surroundings import SurroundingsRecipe

_LENGTH_M, _SPACING_M = 900.0, 50.0


def lane(name: str, start_m: Float64Array, end_m: Float64Array) -> Strip:
    line_m = np.array([start_m, end_m])
    along = (line_m[1] - line_m[0]) / np.linalg.norm(line_m[1] - line_m[0])
    aside_m = 1.75 * np.array([-along[1], along[0], 0.0])
    return Strip(name, name, LaneKind.DRIVING, line_m + aside_m, line_m - aside_m)


def street() -> Layout:
    """A street from x = 50 m to 950 m, its eastbound lane in the south; the border of two regions is at 512 m."""
    west, east = np.array([50.0, 100.0, 0.0]), np.array([50.0 + _LENGTH_M, 100.0, 0.0])
    south = np.array([0.0, -1.75, 0.0])
    return Layout((lane("out", west + south, east + south), lane("back", east - south, west - south)), (), (), ())


def lights_m(column: int, y_m: float) -> Float64Array:
    """(N,) x of the lights on one side of the street, in one region."""
    region = Region(column, 0)
    owns = lambda xy_m: (np.floor(xy_m / REGION_M) == region).all(axis=-1)  # noqa: E731
    ground = SimpleNamespace(region=region, network=SimpleNamespace(layout=street()), owns=owns)
    x0, _, x1, _ = region.area.bounds
    x_m = np.arange(max(x0, 50.0) + 1.3, min(x1, 950.0) - 1.0, STATION_M)
    position_m = np.column_stack([x_m, np.full(len(x_m), y_m)])
    curb = CurbLine(position_m, np.zeros(len(x_m)), SurroundingsRecipe(use="residential"), walk=True)
    lanes = Lanes.of_level(ground, 0)  # type: ignore[arg-type]
    candidates = light_positions(ground, curb, lanes, _SPACING_M)  # type: ignore[arg-type]
    return np.array([x_m[choice[0]] for choice in candidates])


def test_lights_are_evenly_spaced_across_the_border_of_two_regions() -> None:
    x_m = np.concatenate([lights_m(0, 95.0), lights_m(1, 95.0)])
    assert len(x_m) == _LENGTH_M / _SPACING_M
    assert np.diff(x_m) == pytest.approx(_SPACING_M, abs=2.0 * STATION_M)


def test_lights_of_the_two_sides_are_staggered_by_half_a_spacing() -> None:
    south_m, north_m = (np.concatenate([lights_m(0, y_m), lights_m(1, y_m)]) for y_m in (95.0, 105.0))
    nearest_m = np.abs(south_m[:, None] - north_m).min(axis=1)
    assert nearest_m == pytest.approx(_SPACING_M / 2.0, abs=2.0 * STATION_M)
