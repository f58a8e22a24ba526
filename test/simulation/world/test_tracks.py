"""Equal positions on the lanes of an edge lie abreast of each other, however the edge bends."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_roads import made_up_lane

from simbev_ros.maps.network import Lane
from simbev_ros.simulation.world.sumo.tracks import LaneTracks

STRAIGHT_M, RADIUS_M, SPACING_M = 150.0, 20.0, 3.5


def bending_lane(index: int) -> Lane:
    """One of three lanes: straight ahead, a quarter turn to the left around (150, 20), then 30 m north."""
    radius_m = RADIUS_M - SPACING_M * (index - 1)
    angle = np.linspace(0.0, np.pi / 2, 60)
    arc_m = np.column_stack([STRAIGHT_M + radius_m * np.sin(angle), RADIUS_M - radius_m * np.cos(angle), 0 * angle])
    end_m = arc_m[-1] + np.array([0.0, 30.0, 0.0])
    line_m = np.vstack([[0.0, RADIUS_M - radius_m, 0.0], arc_m, end_m])
    shape = made_up_lane(f"A_{index}", line_m=line_m)
    return replace(shape, sumo_s_per_m=200.0 / shape.length_m)


LANES = [bending_lane(index) for index in range(3)]
TRACKS = LaneTracks([made_up_lane("B_0"), *LANES])


def track_positions(index: int, sumo_positions_m: np.ndarray, left_m: float = 0.0) -> np.ndarray:
    return TRACKS.positions_m(
        [f"A_{index}"] * len(sumo_positions_m), sumo_positions_m, np.full(len(sumo_positions_m), left_m)
    )


def test_a_vehicle_that_changes_lanes_moves_sideways_only() -> None:
    sumo_positions_m = np.linspace(0.0, 200.0, 81)
    for index in (0, 1):
        right_m = track_positions(index, sumo_positions_m, SPACING_M / 2)
        left_m = track_positions(index + 1, sumo_positions_m, -SPACING_M / 2)
        assert np.linalg.norm(right_m - left_m, axis=1).max() < 0.15
    # By length alone, as in SUMO, they would be meters apart.
    uniform_m = [
        [
            np.interp(sumo_positions_m / 200.0 * each.length_m, stations(each), each.centerline_m[:, axis])
            for axis in (0, 1)
        ]
        for each in LANES[:2]
    ]
    assert np.linalg.norm(np.diff(uniform_m, axis=0)[0], axis=0).max() > SPACING_M + 0.5


def stations(each: Lane) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(each.centerline_m[:, :2], axis=0), axis=1))])


@pytest.mark.slow
def test_positions_lie_on_the_lanes_and_advance_steadily() -> None:
    sumo_positions_m = np.linspace(0.0, 200.0, 401)
    for index, each in enumerate(LANES):
        points_m = track_positions(index, sumo_positions_m)
        nearest_m = np.linalg.norm(points_m[:, None] - dense(each)[None], axis=2).min(axis=1)
        assert nearest_m.max() < 0.03
        steps_m = np.linalg.norm(np.diff(points_m, axis=0), axis=1)
        assert steps_m.min() > 0.3 and steps_m.max() < 0.75
        np.testing.assert_allclose(points_m[[0, -1]], each.centerline_m[[0, -1]], atol=1e-9)


def dense(each: Lane) -> np.ndarray:
    s_m = np.linspace(0.0, each.length_m, 20_000)
    return np.column_stack([np.interp(s_m, stations(each), each.centerline_m[:, axis]) for axis in range(3)])


@pytest.mark.parametrize("s_m", [0.0, 12.0, 149.0, 160.0, 171.5])
def test_sumo_position_is_the_inverse_of_the_map_position(s_m: float) -> None:
    for index, each in enumerate(LANES):
        position_m = TRACKS.sumo_position_m(each.id, s_m)
        expected_m = [np.interp(s_m, stations(each), each.centerline_m[:, axis]) for axis in range(3)]
        np.testing.assert_allclose(track_positions(index, np.array([position_m]))[0], expected_m, atol=0.03)


def test_left_is_to_the_left() -> None:
    np.testing.assert_allclose(TRACKS.positions_m(["B_0"], np.array([40.0]), np.array([1.2])), [[40.0, 1.2, 0.0]])


def test_unknown_lanes_are_an_error() -> None:
    with pytest.raises(KeyError, match="C_0"):
        TRACKS.positions_m(["C_0"], np.zeros(1), np.zeros(1))


def test_no_lane_stands_still_while_its_neighbor_turns_away() -> None:
    angle = np.linspace(0.0, np.pi, 40)
    turning_m = np.column_stack([5.0 * np.sin(angle), 7.0 - 5.0 * np.cos(angle), 0.0 * angle])
    turning = made_up_lane("A_1", line_m=turning_m)
    ahead = made_up_lane("A_0", length_m=20.0)
    sumo_positions_m = np.linspace(0.0, 20.0, 41)
    positions_m = LaneTracks([ahead, turning]).positions_m(["A_0"] * 41, sumo_positions_m, np.zeros(41))
    np.testing.assert_allclose(np.diff(positions_m[:, 0]), 0.5, atol=0.16)
