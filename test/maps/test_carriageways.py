import numpy as np
import pytest
import shapely
from road_strips import layout_of_strips, level_ground, side_by_side, straight

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.roads.carriageways import cut_into_blocks
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.roads.level_members import LevelGraph
from simbev_ros.maps.roads.levels import assign_levels


def _bend(name: str, inner_m: float, outer_m: float, points: int, back: bool = False) -> Strip:
    """A lane through a quarter circle about the origin, counter-clockwise, or back."""
    turn_rad = np.linspace(0.0, np.pi / 2.0, points)
    circle = np.column_stack([np.cos(turn_rad), np.sin(turn_rad), np.zeros(points)])
    sides_m = (outer_m * circle[::-1], inner_m * circle[::-1]) if back else (inner_m * circle, outer_m * circle)
    return Strip(name, name, LaneKind.DRIVING, *sides_m)


def test_lanes_of_a_bend_are_cut_at_the_same_angles() -> None:
    lanes = [_bend("back", 40.0, 43.5, 201, back=True), _bend("left", 43.5, 47.0, 301), _bend("right", 47.0, 55.0, 451)]
    apart = _bend("apart", 60.0, 63.0, 50)
    pieces, block = cut_into_blocks([*lanes, apart], 6.0)
    ends_m = np.stack([pieces.position_m(0.0), pieces.position_m(1.0)])
    angles_rad = np.sort(np.arctan2(ends_m[..., 1], ends_m[..., 0]), axis=0)
    for number in np.unique(block):
        rows = np.flatnonzero(block == number)
        assert sorted(pieces.row[rows].tolist()) in ([0, 1, 2], [3])
        assert np.ptp(angles_rad[:, rows], axis=1).max() * 55.0 < 0.1, (
            "on one straight line across, as accurately as polygons approximate arcs"
        )
    whole_m2 = shapely.union_all(pieces.polygons).area
    assert whole_m2 == pytest.approx(np.pi / 4.0 * (55.0**2 - 40.0**2 + 63.0**2 - 60.0**2), rel=1e-3)


def _arched(xy_m: Float64Array) -> Float64Array:
    return np.asarray(np.maximum(7.0 - 0.07 * np.abs(xy_m[:, 0]), 0.0))


def test_level_members_end_straight_across_a_road() -> None:
    """A three-lane road climbs over another, which cuts its lanes askew; the path down is long."""
    under = straight("under", (-60, -140), (60, 140), level_ground)
    over = side_by_side(3, name="over", start_m=(-140, 0), end_m=(140, 0), height=_arched)
    graph = LevelGraph(assign_levels(layout_of_strips(under, *over)))
    members = graph.members(np.array([0.0, 0.0, 0.0]))
    assert members is not None
    for away in (members.belongs, ~members.belongs):
        chosen = [row for row in np.flatnonzero(away).tolist() if members.strip[row].startswith("over")]
        areas = [graph.polygons[members.piece[row]] for row in chosen]
        by_lane = [
            shapely.union_all(
                [area for row, area in zip(chosen, areas, strict=True) if f"over{k}" in members.strip[row]]
            )
            for k in range(3)
        ]
        ends_m = np.array([lane.bounds[0::2] for lane in by_lane])
        assert np.ptp(ends_m, axis=0).max() < 0.01
