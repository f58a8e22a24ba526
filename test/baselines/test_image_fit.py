"""Images of any camera come to the model's size, and projections still point at what the images show."""

import math

import cv2
import numpy as np
import pytest
import simplejpeg

from simbev_ros.baselines.node.image_fit import ImageFit
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.types import Float64Array, UInt8Array

SIZE_PX = (704, 256)
TRAINED_ON = PinholeCamera(704, 256, 419.5, 419.5, 352.0, 58.0)


def camera(width_px: int, height_px: int, fov_deg: float = 80.0) -> PinholeCamera:
    return PinholeCamera.from_field_of_view(width_px, height_px, math.radians(fov_deg))


def with_dot(width_px: int, height_px: int, u: int, v: int) -> UInt8Array:
    """A black image with a soft white dot."""
    image = np.zeros((height_px, width_px, 3), np.uint8)
    image[v, u] = 255
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 5.0) * np.uint8(10), np.uint8)


def centroid(image: UInt8Array) -> Float64Array:
    """(u, v) of an image's brightness."""
    weight = image[..., 1].astype(np.float64)
    rows, columns = np.indices(weight.shape)
    return np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()


def test_images_like_those_of_the_training_data_are_left_as_they_are() -> None:
    fit = ImageFit.of_camera(TRAINED_ON, SIZE_PX)
    image = np.random.default_rng(0).integers(0, 255, (256, 704, 3), np.uint8)
    assert fit.fitted_from_source == pytest.approx(np.eye(3))
    assert (fit.fit(image) == image).all()


@pytest.mark.parametrize("size_px", [(1600, 900), (800, 450), (480, 270), (640, 480), (96, 64)])
def test_cameras_with_the_field_of_view_of_the_training_data_get_its_intrinsics(size_px: tuple[int, int]) -> None:
    source = camera(*size_px)
    fitted = ImageFit.of_camera(source, SIZE_PX).fitted_from_source @ source.matrix
    assert fitted[0, 0] == pytest.approx(419.5, abs=0.1)
    assert fitted[1, 1] == pytest.approx(419.5, rel=0.01)
    assert fitted[:2, 2] == pytest.approx([352.0, 58.0], abs=0.6)


def test_a_wide_camera_keeps_its_whole_width() -> None:
    source = camera(1280, 720, 120.0)
    fit = ImageFit.of_camera(source, SIZE_PX)
    assert (fit.fitted_from_source @ source.matrix)[0, 0] == pytest.approx(source.fx_px * 704 / 1280)
    left, right = (fit.fitted_from_source @ [u, 0.0, 1.0] for u in (-0.5, 1279.5))
    assert (left[0], right[0]) == pytest.approx((-0.5, 703.5))


@pytest.mark.parametrize("size_px", [(1600, 900), (480, 270)])
def test_the_projection_points_at_what_the_fitted_image_shows(size_px: tuple[int, int]) -> None:
    u, v = size_px[0] // 5, size_px[1] * 3 // 5
    fit = ImageFit.of_camera(camera(*size_px), SIZE_PX)
    image = with_dot(*size_px, u, v)
    expected = (fit.fitted_from_source @ [u, v, 1.0])[:2]
    assert centroid(fit.fit(image)) == pytest.approx(expected, abs=0.1)
    jpeg = simplejpeg.encode_jpeg(image, quality=95)
    assert centroid(fit.decode(jpeg)) == pytest.approx(expected, abs=0.3)


def test_rows_that_the_camera_lacks_are_black() -> None:
    fit = ImageFit.of_camera(PinholeCamera(704, 100, 419.5, 419.5, 352.0, 40.0), SIZE_PX)
    fitted = fit.fit(np.full((100, 704, 3), 200, np.uint8))
    assert fitted.shape == (256, 704, 3)
    assert (fitted[:100] == 200).all() and (fitted[100:] == 0).all()


def test_a_damaged_jpeg_is_a_value_error() -> None:
    with pytest.raises(ValueError, match="subsampling level of JPEG"):
        ImageFit.of_camera(TRAINED_ON, SIZE_PX).decode(b"no JPEG")
