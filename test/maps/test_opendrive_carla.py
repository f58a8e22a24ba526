"""Compares OpenDRIVE imports with CARLA's own reading of its towns: road area, heights, lane records, crosswalks."""

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import shapely

from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.opendrive.importer import import_opendrive
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.roads.layout import Paint, Strip
from simbev_ros.maps.roads.levels import assign_levels
from simbev_ros.maps.roads.surface import surfaces_of

carla: ModuleType = pytest.importorskip("carla")

_MAPS = Path(__file__).parents[2].parent / "shared" / "maps" / "carla"
_CELL_M = 0.4
_PAINTS = {
    "NONE": {Paint.NONE},
    "Broken": {Paint.BROKEN},
    "Solid": {Paint.SOLID},
    "SolidSolid": {Paint.SOLID_SOLID},
    "Curb": {Paint.CURB},
}


@pytest.fixture(scope="module", params=["Town01", "Town04"])
def town(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, MapParts]:
    path = _MAPS / f"{request.param}.xodr"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    parts = import_opendrive(path, tmp_path_factory.mktemp(request.param))
    return carla.Map(request.param, path.read_text(encoding="utf-8")), parts


def position_m(waypoint: Any) -> tuple[float, float, float]:
    """Position in our frame, in which y is opposite to CARLA's."""
    location = waypoint.transform.location
    return location.x, -location.y, location.z


def near_waypoints(waypoints_m: Float64Array, reach_m: Float64Array, x_m: Float64Array, y_m: Float64Array) -> BoolArray:
    """(rows, columns) whether a cell's center is closer to a waypoint than its reach."""
    near = np.zeros((len(y_m), len(x_m)), bool)
    for (x, y), reach in zip(waypoints_m, reach_m, strict=True):
        columns = slice(*np.searchsorted(x_m, [x - reach, x + reach]))
        rows = slice(*np.searchsorted(y_m, [y - reach, y + reach]))
        near[rows, columns] |= (x_m[columns] - x) ** 2 + (y_m[rows, None] - y) ** 2 < reach**2
    return near


def by_lane(parts: MapParts) -> dict[str, list[Strip]]:
    lanes: dict[str, list[Strip]] = {}
    for strip in parts.layout.strips:
        lanes.setdefault(strip.lane, []).append(strip)
    return lanes


def lane_of(waypoint: Any) -> str:
    return f"{waypoint.road_id}/{waypoint.section_id}/{waypoint.lane_id}"


def nearest(strips: list[Strip], position: tuple[float, float, float]) -> tuple[Strip, int, float, float]:
    """The nearest of one lane's strips, the segment of its center line, the fraction along it, and the distance."""
    best: tuple[Strip, int, float, float] | None = None
    for strip in strips:
        start, step = strip.center_m[:-1, :2], np.diff(strip.center_m[:, :2], axis=0)
        fraction = np.clip(np.sum((position[:2] - start) * step, axis=1) / np.sum(step**2, axis=1), 0.0, 1.0)
        gap_m = np.linalg.norm(start + fraction[:, None] * step - position[:2], axis=1)
        row = int(np.argmin(gap_m))
        if best is None or gap_m[row] < best[3]:
            best = strip, row, float(fraction[row]), float(gap_m[row])
    assert best is not None
    return best


def test_road_area_matches_carla(town: tuple[Any, MapParts]) -> None:
    carla_map, parts = town
    waypoints = carla_map.generate_waypoints(_CELL_M)
    positions_m = np.array([position_m(w)[:2] for w in waypoints])
    low, high = positions_m.min(axis=0) - 5.0, positions_m.max(axis=0) + 5.0
    x_m, y_m = (np.arange(low[axis], high[axis], _CELL_M) for axis in (0, 1))
    theirs = near_waypoints(positions_m, np.array([w.lane_width for w in waypoints]) / 2.0, x_m, y_m)
    layout = assign_levels(parts.layout)
    area = shapely.union_all([surfaces_of(layout, level).road for level in layout.levels])
    shapely.prepare(area)
    ours = shapely.contains_xy(area, *np.meshgrid(x_m, y_m))
    iou = np.sum(ours & theirs) / np.sum(ours | theirs)
    assert iou > 0.99


def test_every_waypoint_lies_on_the_middle_of_its_lane_at_its_height(town: tuple[Any, MapParts]) -> None:
    carla_map, parts = town
    lanes = by_lane(parts)
    rng = np.random.default_rng(1)
    waypoints = carla_map.generate_waypoints(_CELL_M)
    offsets_m, heights_m, widths_m, turns_rad = [], [], [], []
    for row in rng.choice(len(waypoints), 3000):
        waypoint = waypoints[row]
        strip, k, fraction, gap_m = nearest(lanes[lane_of(waypoint)], position_m(waypoint))
        step = strip.center_m[k + 1] - strip.center_m[k]
        across = np.linalg.norm((strip.left_m - strip.right_m)[k : k + 2, :2], axis=1)
        yaw_rad = -np.radians(waypoint.transform.rotation.yaw)
        offsets_m.append(gap_m)
        heights_m.append(strip.center_m[k, 2] + fraction * step[2] - position_m(waypoint)[2])
        widths_m.append(across[0] + fraction * (across[1] - across[0]) - waypoint.lane_width)
        turns_rad.append(np.angle(np.exp(1j * (np.arctan2(step[1], step[0]) - yaw_rad))))
    assert np.max(offsets_m) < 0.02
    assert np.percentile(np.abs(heights_m), 99) < 0.02
    assert np.max(np.abs(widths_m)) < 0.01
    assert np.max(np.abs(turns_rad)) < 0.1


def test_lane_records_match_carla(town: tuple[Any, MapParts]) -> None:
    carla_map, parts = town
    lanes = by_lane(parts)
    rng = np.random.default_rng(2)
    waypoints = carla_map.generate_waypoints(2.0)
    seen = set()
    for row in rng.choice(len(waypoints), 1500):
        waypoint = waypoints[row]
        strip, k, fraction, _ = nearest(lanes[lane_of(waypoint)], position_m(waypoint))
        along_m = np.linalg.norm(np.diff(strip.center_m[:, :2], axis=0), axis=1)
        at_m = along_m[:k].sum() + fraction * along_m[k]
        if min(at_m, along_m.sum() - at_m) < 0.5:
            continue  # paint changes nearby
        assert (strip.junction != "") == waypoint.is_junction
        for line, theirs in (
            (strip.left_line, waypoint.left_lane_marking),
            (strip.right_line, waypoint.right_lane_marking),
        ):
            assert line.paint in _PAINTS[str(theirs.type)], lane_of(waypoint)
            if line.paint is not Paint.NONE:
                assert line.color.value == str(theirs.color).lower()
                assert line.width_m == pytest.approx(theirs.width)
                seen.add((line.paint, line.color))
        for neighbor, theirs in ((strip.left, waypoint.get_left_lane()), (strip.right, waypoint.get_right_lane())):
            assert neighbor == (lane_of(theirs) if theirs is not None and neighbor else "")
    assert len(seen) >= 1


def test_lane_successors_match_carla(town: tuple[Any, MapParts]) -> None:
    carla_map, parts = town
    lanes = by_lane(parts)
    rng = np.random.default_rng(3)
    waypoints = carla_map.generate_waypoints(5.0)
    for row in rng.choice(len(waypoints), 300):
        last = waypoints[row].next_until_lane_end(0.5)[-1]
        theirs = {lane_of(w) for w in last.next(0.6)} - {lane_of(last)}
        if lane_of(last) == lane_of(waypoints[row]) and theirs:
            assert set(lanes[lane_of(last)][0].following) == theirs


def test_crosswalks_match_carla(town: tuple[Any, MapParts]) -> None:
    carla_map, parts = town
    corners = [(c.x, -c.y, c.z) for c in carla_map.get_crosswalks()]
    if not corners:
        pytest.skip("this town has none")
    gaps_m = [
        np.min(np.linalg.norm(crosswalk.outline_m - corner, axis=1))
        for corner in corners
        for crosswalk in parts.layout.crosswalks
    ]
    gaps_m = np.reshape(gaps_m, (len(corners), -1)).min(axis=1)
    assert gaps_m.max() < 0.1


def test_traffic_light_positions_match_carla(town: tuple[Any, MapParts]) -> None:
    carla_map, parts = town
    theirs_m = np.array([position_m(landmark)[:2] for landmark in carla_map.get_all_landmarks_of_type("1000001")])
    ours_m = np.array([position.foot_m[:2] for position in parts.layout.signal_places])
    gaps_m = np.linalg.norm(theirs_m[:, None] - ours_m[None], axis=2)
    assert np.percentile(gaps_m.min(axis=1), 95) < 0.3  # CARLA moves each by 0.25 m, and some off the road
    assert np.percentile(gaps_m.min(axis=0), 95) < 0.3
