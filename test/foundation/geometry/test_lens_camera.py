"""The lens model agrees with OpenCV's independent implementation, and lenses that are not invertible are rejected."""

import cv2
import numpy as np
import pytest

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera, ideal_camera
from simbev_ros.foundation.types import Float64Array

K = (1600, 900, 950.0, 940.0, 790.3, 455.2)
LENSES = [
    LensCamera(*K, distortion=(-0.3, 0.1, 0.001, -0.0005, -0.01)),
    LensCamera(*K, distortion=(0.2, 0.05, -0.004, 0.002, 0.0)),
    LensCamera(*K, distortion=(-0.36, 0.16, 0.0, 0.0, -0.02)),
]


def pixels(camera: PinholeCamera) -> Float64Array:
    """(N, 2) corners of the image, and random pixels all over it."""
    corners = [(u, v) for u in (0, camera.width_px - 1) for v in (0, camera.height_px - 1)]
    rng = np.random.default_rng(0)
    inner = rng.uniform(0, [camera.width_px - 1, camera.height_px - 1], (2000, 2))
    return np.concatenate([np.array(corners, float), inner])


@pytest.mark.parametrize("lens", LENSES)
def test_points_project_to_the_same_pixels_as_in_opencv(lens: LensCamera) -> None:
    points = lens.rays(pixels(lens)) * np.random.default_rng(1).uniform(0.5, 80.0, (2004, 1))
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), lens.matrix, np.array(lens.distortion))
    np.testing.assert_allclose(lens.project(points), expected[:, 0], atol=1e-9)


@pytest.mark.parametrize("lens", LENSES)
def test_rays_are_those_that_opencv_projects_to_their_pixels(lens: LensCamera) -> None:
    rays = lens.rays(pixels(lens))
    back, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), lens.matrix, np.array(lens.distortion))
    np.testing.assert_allclose(back[:, 0], pixels(lens), atol=1e-6)
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 1000, 1e-14)
    undistorted = cv2.undistortPoints(pixels(lens), lens.matrix, np.array(lens.distortion), criteria=stop)
    np.testing.assert_allclose(rays[:, :2], undistorted[:, 0], atol=1e-6)


def test_a_lens_without_distortion_is_a_pinhole() -> None:
    lens, pinhole = LensCamera(*K, distortion=(0.0,) * 5), PinholeCamera(*K)
    np.testing.assert_allclose(lens.rays(pixels(lens)), pinhole.rays(pixels(lens)), atol=1e-14)
    assert ideal_camera(pinhole) is pinhole


@pytest.mark.parametrize("lens", LENSES)
def test_ideal_camera_covers_the_image_and_is_nowhere_coarser(lens: LensCamera) -> None:
    ideal = ideal_camera(lens)
    image_px = pixels(lens)
    ideal_px = ideal.project(lens.rays(image_px))
    assert (ideal_px >= 1.0).all() and (ideal_px <= [ideal.width_px - 2, ideal.height_px - 2]).all()
    for step in ([0.01, 0.0], [0.0, 0.01], [0.007, 0.007]):
        moved = ideal.project(lens.rays(image_px + step))
        assert (np.linalg.norm(moved - ideal_px, axis=1) / np.linalg.norm(step)).min() > 0.99
    assert ideal.width_px * ideal.height_px < 2.5 * lens.width_px * lens.height_px


def test_points_beyond_the_one_to_one_range_of_the_model_project_to_nan() -> None:
    """With k1 = -0.3 the distorted radius grows up to r² = 1 / 0.9."""
    lens = LensCamera(640, 480, 800.0, 800.0, 319.5, 239.5, (-0.3, 0.0, 0.0, 0.0, 0.0))
    points = np.array([[np.sqrt(1.1), 0.0, 1.0], [np.sqrt(1.2), 0.0, 1.0]])
    assert np.isnan(lens.project(points)).all(axis=1).tolist() == [False, True]


@pytest.mark.parametrize(
    ("intrinsics", "distortion"),
    [
        (K, (-0.6, 0.1, 0.0, 0.0, 0.0)),  # turns back before the corners
        (K, (0.0, 0.0, 0.9, 0.0, 0.0)),  # the tangential part is not one-to-one
        ((1600, 900, 60.0, 60.0, 799.5, 449.5), (-1e-4, 0.0, 0.0, 0.0, 0.0)),  # corners more than 85° off the axis
    ],
)
def test_a_lens_that_cannot_be_inverted_is_rejected_by_name(
    intrinsics: tuple[int, int, float, float, float, float], distortion: tuple[float, ...]
) -> None:
    with pytest.raises(InputError, match=r"distortion: k1 .* cannot be inverted over the whole image"):
        LensCamera(*intrinsics, distortion=distortion)
