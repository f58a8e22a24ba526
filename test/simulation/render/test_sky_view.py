"""The open sky between houses: shares by hand, and walls that see the side they face."""

import numpy as np
import pytest

from simbev_ros.simulation.render.lighting.sky_view import sky_view


def _level_share(cell: np.ndarray, height_m: float) -> float:
    """Share of the sky's light on a level surface, as the shader computes it."""
    return 1.0 / (1.0 + (max(cell[0] - height_m, 0.0) * cell[1]) ** 2)


def test_open_land_sees_the_whole_sky_at_any_height() -> None:
    view = sky_view(np.full((64, 64), 3.0), 1.0)
    assert _level_share(view[30, 30], 3.0) == pytest.approx(1.0)
    np.testing.assert_allclose(view[..., 2:], 0.0, atol=1e-6)


def test_beside_a_long_wall_half_of_the_sky_is_open_and_walls_that_face_away_see_it() -> None:
    height_m = np.zeros((128, 128))
    height_m[:, 70:] = 200.0  # all of the land in +x is a plateau, so high that it hides that half of the sky
    beside = sky_view(height_m, 1.0)[64, 68]
    assert _level_share(beside, 0.0) == pytest.approx(0.5, abs=0.02)
    assert _level_share(beside, 200.0) == 1.0
    assert beside[2] == pytest.approx(-1.0 / np.pi, abs=0.02)
    assert beside[3] == pytest.approx(0.0, abs=1e-6)
    facing_away = _level_share(beside, 0.0) - np.pi / 2.0 * beside[2]
    assert facing_away == pytest.approx(1.0, abs=0.05)


def test_posts_hide_no_sky() -> None:
    height_m = np.zeros((64, 64))
    height_m[30:32, 30] = 9.0
    np.testing.assert_allclose(sky_view(height_m, 1.0), sky_view(np.zeros((64, 64)), 1.0))
