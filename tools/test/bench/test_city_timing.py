"""A city that is repeated side by side for ``python -m tools.bench city``."""

from pathlib import Path

import numpy as np
import pytest

from simbev_ros.maps.osm.reader import read_osm
from tools.bench.city_timing import repeat_city, timed_city

SAMPLE = Path(__file__).parents[3] / "test/maps" / "data" / "riverside.osm"


def test_a_repeated_city_has_all_objects_of_each_copy(tmp_path: Path) -> None:
    repeat_city(SAMPLE, 2, tmp_path / "city.osm.pbf")
    one, four = read_osm(SAMPLE), read_osm(tmp_path / "city.osm.pbf")
    assert len(four.ways) == 4 * len(one.ways)
    assert len(four.multipolygons) == 4 * len(one.multipolygons)
    spans_deg = [np.ptp(data.longitude_latitude_deg, axis=0) for data in (one, four)]
    np.testing.assert_allclose(spans_deg[1], 2.0 * spans_deg[0], atol=1e-6)


@pytest.mark.slow
def test_each_area_of_a_city_is_built_whole(tmp_path: Path) -> None:
    timing = timed_city(SAMPLE, (1, 3))
    one, nine = timing.buildings
    np.testing.assert_allclose(nine.area_km2, 9.0 * one.area_km2, rtol=0.1)
    np.testing.assert_allclose(nine.lane_km, 9.0 * one.lane_km, rtol=0.05)
    assert [len(row) for row in timing.rows()] == [7, 7]
