"""Clipping to patches: against shapely on random lines, and special cases of rings and levels."""

import numpy as np
import pytest
import shapely
from synthetic_world import EGO_ID, actor, box_model, world

from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.simulation.annotation.vector_map.patch import Patch, PatchLines

CAR = box_model(Tag.CAR, (4.0, 2.0, 1.5))
POSES = [(0.0, 0.0, 0.0), (12.0, -7.0, 0.6), (-20.0, 15.0, -2.9), (3.0, 4.0, np.pi / 2)]
SIZE_M = 60.0, 30.0


def patch_at(x: float, y: float, yaw: float, z: float = 0.0) -> Patch:
    return Patch.around_ego(world(actor(CAR, id=EGO_ID, x=x, y=y, z=z, yaw=yaw)), *SIZE_M)


def in_map(patch: Patch, points: Float64Array) -> Float64Array:
    """(N, 3) points of the patch frame in the map frame."""
    forward = np.array([np.cos(patch.yaw_rad), np.sin(patch.yaw_rad)])
    left = np.array([-forward[1], forward[0]])
    xy = patch.origin_m[:2] + points[:, :1] * forward + points[:, 1:2] * left
    return np.column_stack([xy, points[:, 2] + patch.origin_m[2]])


def wandering_lines() -> list[Float64Array]:
    """Lines that cross patches many times, with long and short steps, some with corners on round numbers."""
    rng = np.random.default_rng(5)
    free = [np.cumsum(rng.normal(0.0, [step, step, 0.3], (40, 3)), axis=0) for step in (0.5, 3.0, 15.0, 60.0) * 10]
    square = [np.round(line_m / 15.0) * 15.0 for line_m in free]  # along the borders of the first patch, and on corners
    return free + [line_m for line_m in square if len(np.unique(line_m, axis=0)) > 1]


@pytest.mark.parametrize("pose", POSES)
def test_pieces_agree_with_shapely(pose: tuple[float, float, float]) -> None:
    lines_m = [line_m[np.append(True, np.any(np.diff(line_m, axis=0), axis=1))] for line_m in wandering_lines()]
    patch = patch_at(*pose, z=2.0)
    corners = np.array([[30.0, 15.0, 0.0], [-30.0, 15.0, 0.0], [-30.0, -15.0, 0.0], [30.0, -15.0, 0.0]])
    window = shapely.Polygon(in_map(patch, corners)[:, :2])
    found = PatchLines(lines_m).within(patch, None)
    for row, line_m in enumerate(lines_m):
        # Segment by segment: shapely cuts lines that cross themselves where they do.
        segments = shapely.linestrings(np.stack([line_m[:-1, :2], line_m[1:, :2]], axis=1))
        expected = shapely.intersection(segments, window)
        pieces = [in_map(patch, piece) for piece in found.get(row, ())]
        length_m = sum(np.linalg.norm(np.diff(piece[:, :2], axis=0), axis=1).sum() for piece in pieces)
        assert length_m == pytest.approx(shapely.length(expected).sum(), abs=1e-6)
        if length_m < 1e-6:
            continue
        lines = shapely.MultiLineString([piece[:, :2] for piece in pieces])
        long = expected[shapely.length(expected) > 1e-6]
        assert shapely.hausdorff_distance(lines, shapely.union_all(long)) < 1e-6


def test_heights_lie_on_the_line_and_ends_on_the_border() -> None:
    line_m = np.array([[-100.0, 3.0, 0.0], [100.0, 3.0, 20.0]])
    (piece,) = PatchLines([line_m]).within(patch_at(10.0, 0.0, 0.0, z=5.0), None)[0]
    assert piece == pytest.approx(np.array([[-30.0, 3.0, 3.0], [30.0, 3.0, 9.0]]))


def test_a_ring_that_begins_in_the_patch_stays_one_piece() -> None:
    ring_m = np.array([[0.0, 5, 0], [0, 10, 0], [50, 10, 0], [50, 5, 0], [0, 5, 0]])
    (piece,) = PatchLines([ring_m]).within(patch_at(0.0, 0.0, 0.0), None)[0]
    assert piece == pytest.approx(np.array([[30.0, 5, 0], [0, 5, 0], [0, 10, 0], [30, 10, 0]]))
    (whole,) = PatchLines([ring_m * [0.1, 1.0, 1.0]]).within(patch_at(0.0, 0.0, 0.0), None)[0]
    assert whole.tolist() == (ring_m * [0.1, 1.0, 1.0]).tolist()


def test_segments_that_are_not_real_are_left_out() -> None:
    line_m = np.array([[x, 0.0, 0.0] for x in (-5.0, 0.0, 5.0, 9.0)])
    found = PatchLines([line_m], real=[np.array([True, False, True])]).within(patch_at(0.0, 0.0, 0.0), None)
    assert [piece[:, 0].tolist() for piece in found[0]] == [[-5, 0], [5, 9]]


def test_sections_are_cut_out_where_the_guide_is_off_the_level() -> None:
    line_m = np.array([[-50.0, 2.0, 0.0], [50.0, 2.0, 0.0]])
    guide_m = line_m - np.array([0.0, 2.0, 0.0])

    def level_filter(positions_m: Float64Array) -> BoolArray:
        assert (positions_m[:, 1] == 0.0).all()
        return np.asarray(np.abs(positions_m[:, 0]) > 10.0)

    pieces = PatchLines([line_m], guides_m=[guide_m]).within(patch_at(0.0, 0.0, 0.0), level_filter)[0]
    ends = [piece[[0, -1], 0] for piece in pieces]
    assert np.array(ends) == pytest.approx(np.array([[-30, -10], [10, 30]]), abs=1.0)
    assert [len(piece) for piece in pieces] == [2, 2]


def test_without_lines_there_are_no_pieces() -> None:
    assert PatchLines([]).within(patch_at(0.0, 0.0, 0.0), None) == {}
