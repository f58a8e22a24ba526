"""The fisheye model agrees with OpenCV's, its faces cover its view, and models that are not one-to-one are rejected."""

import cv2
import numpy as np
import pytest

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera, cube_faces, focal_length_px
from simbev_ros.foundation.types import Float64Array

WIDE_RAD = float(np.radians(100.0))
LENSES = [
    FisheyeCamera(1280, 960, 340.0, 338.0, 630.3, 485.2, (0.02, -0.006, 0.001, -0.0002), WIDE_RAD),
    FisheyeCamera(1280, 960, 380.0, 380.0, 639.5, 479.5, (0.0, 0.0, 0.0, 0.0), float(np.radians(95.0))),
    FisheyeCamera(640, 400, 300.0, 305.0, 325.0, 190.0, (-0.05, 0.01, 0.0, -0.002), float(np.radians(80.0))),
]


def points_m(lens: FisheyeCamera, max_angle_rad: float) -> Float64Array:
    """(N, 3) random points up to an angle to the optical axis."""
    rng = np.random.default_rng(1)
    angle, turn = rng.uniform(0.0, max_angle_rad, 3000), rng.uniform(0.0, 2.0 * np.pi, 3000)
    direction = np.stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)], axis=1)
    return direction * rng.uniform(0.5, 80.0, (3000, 1))


@pytest.mark.parametrize("lens", LENSES)
def test_points_project_to_the_same_pixels_as_in_opencv(lens: FisheyeCamera) -> None:
    """OpenCV divides by z, so it is defined below 90°."""
    points = points_m(lens, min(lens.max_angle_rad, np.radians(89.9)))
    expected, _ = cv2.fisheye.projectPoints(
        points[:, None], np.zeros(3), np.zeros(3), lens.matrix, np.array(lens.distortion)
    )
    np.testing.assert_allclose(lens.project(points), expected[:, 0], atol=1e-6)


@pytest.mark.parametrize("lens", LENSES)
def test_rays_are_those_of_opencv(lens: FisheyeCamera) -> None:
    pixels = lens.project(points_m(lens, min(lens.max_angle_rad, np.radians(85.0))))
    plane = cv2.fisheye.undistortPoints(pixels[:, None], lens.matrix, np.array(lens.distortion))[:, 0]
    rays = lens.rays(pixels)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(rays[:, :2] / rays[:, 2:], plane, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("lens", LENSES)
def test_rays_and_pixels_are_inverse_up_to_the_rim(lens: FisheyeCamera) -> None:
    points = points_m(lens, lens.max_angle_rad - 1e-6)
    rays = lens.rays(lens.project(points))
    np.testing.assert_allclose(rays * lens.depth_m(points)[:, None], points, atol=1e-8)
    beyond = points_m(lens, lens.max_angle_rad) * [1.0, 1.0, -1.0]
    beyond = beyond[beyond[:, 2] < np.cos(lens.max_angle_rad + 1e-6) * lens.depth_m(beyond)]
    assert len(beyond) > 100 and np.isnan(lens.project(beyond)).all()


def test_an_undistorted_fisheye_is_equidistant() -> None:
    lens = LENSES[1]
    directions = np.array([[1.0, 0.0, 0.0], [0.0, -3.0, 0.0], [0.0, 0.0, 2.0]])
    quarter = 380.0 * np.pi / 2.0
    np.testing.assert_allclose(
        lens.project(directions), [[639.5 + quarter, 479.5], [639.5, 479.5 - quarter], [639.5, 479.5]]
    )
    assert np.isnan(lens.rays(np.array([[0.0, 0.0], [1279.0, 959.0]]))).all()


def test_solid_angles_are_those_of_the_pixels_area_on_the_sphere() -> None:
    lens, step = LENSES[0], 1e-3
    pixels = np.array([[lens.cx_px, lens.cy_px], [200.0, 250.0], [640.0, 10.0], [1200.0, 500.0]])
    across, down = (
        (lens.rays(pixels + shift) - lens.rays(pixels - shift)) / (2.0 * step) for shift in ([step, 0], [0, step])
    )
    area = np.linalg.norm(np.cross(across, down), axis=1)
    np.testing.assert_allclose(lens.relative_illumination(lens.rays(pixels)), area / area[0], rtol=1e-5)


@pytest.mark.parametrize("lens", LENSES)
def test_faces_cover_the_image_and_are_nowhere_coarser(lens: FisheyeCamera) -> None:
    u, v = np.meshgrid(np.arange(0, lens.width_px, 7), np.arange(0, lens.height_px, 7))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1).astype(float)
    rays = lens.rays(pixels)
    pixels, rays = pixels[~np.isnan(rays[:, 0])], rays[~np.isnan(rays[:, 0])]
    count = np.zeros(len(rays), int)
    for face in cube_faces(lens):
        own = rays @ face.optical_from_face
        inside = own[:, 2] >= np.abs(own[:, :2]).max(axis=1)
        count += inside
        place_px = face.camera.project(own[inside])
        assert (place_px >= 3.9).all() and (
            place_px <= np.array([face.camera.width_px, face.camera.height_px]) - 4.9
        ).all()
        for step in ([0.01, 0.0], [0.0, 0.01], [0.007, -0.007]):
            moved = face.camera.project(lens.rays(pixels[inside] + step) @ face.optical_from_face)
            growth = np.linalg.norm(moved - place_px, axis=1) / np.linalg.norm(step)
            assert np.nanmin(growth) > 0.99
    assert (count >= 1).all()
    face_px = sum(face.camera.width_px * face.camera.height_px for face in cube_faces(lens))
    assert face_px < 3.1 * lens.width_px * lens.height_px
    assert len(cube_faces(lens)) == (4 if lens is LENSES[2] else 5)


def test_a_lens_that_turns_back_within_the_image_is_rejected_by_name() -> None:
    with pytest.raises(InputError, match=r"k1, k2, k3, k4 -0.2, .*only up to 73\.9\d*°.*1280 x 960 pixels; take"):
        FisheyeCamera(1280, 960, 340.0, 340.0, 639.5, 479.5, (-0.2, 0.0, 0.0, 0.0), WIDE_RAD)
    FisheyeCamera(1280, 960, 340.0, 340.0, 639.5, 479.5, (-0.2, 0.0, 0.0, 0.0), float(np.radians(70.0)))
    FisheyeCamera(1280, 960, 999.0, 999.0, 639.5, 479.5, (-0.2, 0.0, 0.0, 0.0), WIDE_RAD)
    with pytest.raises(InputError, match=r"less than half of the horizontal field of view of 190°"):
        focal_length_px(1280, float(np.radians(190.0)), (-0.2, 0.0, 0.0, 0.0))


def test_an_image_circle_of_a_few_pixels_is_rejected() -> None:
    with pytest.raises(InputError, match=r"fx 1, fy 300: the image circle .* 3\.49 pixels across; at least 16"):
        FisheyeCamera(1280, 960, 1.0, 300.0, 639.5, 479.5, (0.0, 0.0, 0.0, 0.0), WIDE_RAD)
    small = FisheyeCamera(8192, 8192, 6.0, 6.0, 4000.0, 4000.0, (0.0, 0.0, 0.0, 0.0), WIDE_RAD)
    assert len(cube_faces(small)) == 5


def test_a_principal_point_outside_the_image_is_rejected() -> None:
    with pytest.raises(InputError, match=r"cx 1400, cy 479\.5: the principal point of a fisheye must lie in its image"):
        FisheyeCamera(1280, 960, 340.0, 340.0, 1400.0, 479.5, (0.0, 0.0, 0.0, 0.0), WIDE_RAD)
