import pytest
from pydantic import ValidationError

from simbev_ros.config.annotation import Occupancy


def test_the_default_grid_has_two_million_voxels_around_the_ego() -> None:
    grid = Occupancy().grid
    assert grid.shape == (320, 320, 20) and grid.low_m == (-64.0, -64.0, -1.0) and grid.voxel_m == 0.4
    assert grid.corners_ego.min(axis=0).tolist() == [-64, -64, -1]
    assert grid.corners_ego.max(axis=0).tolist() == pytest.approx([64, 64, 7])


def test_the_finest_voxels_are_allowed_for_the_whole_box() -> None:
    assert Occupancy(voxel_m=0.1).grid.shape == (1280, 1280, 80)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"voxel_m": 0.3}, "2 half_side_m 128 is not a whole number of voxel_m 0.3"),
        ({"top_m": 7.1}, "top_m - bottom_m 8.1 is not a whole number of voxel_m 0.4"),
        ({"top_m": -1}, "top_m -1 is not above bottom_m -1"),
        ({"half_side_m": 256, "voxel_m": 0.1}, "5120 x 5120 x 80 voxels; allowed are 150,000,000 in all"),
    ],
)
def test_an_invalid_grid_is_refused(fields: dict[str, float], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Occupancy(**fields)
