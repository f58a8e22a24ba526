"""Pixels of a pasted object: its own ones come, at the height where it stands now, and nearer things stay in front."""

import numpy as np
import pytest

from simbev_ros.foundation.types import AnyArray
from simbev_training.cache.layout import BOX_DTYPE
from simbev_training.training.image_pasting import Images, paste_images

WIDTH_PX, HEIGHT_PX, FOCAL_PX = 160, 80, 100.0
CAMERA_M = 1.5
RED, GRAY = (200, 0, 0), (90, 90, 90)
PROJECTION = np.array(
    [[WIDTH_PX / 2, -FOCAL_PX, 0, 0], [HEIGHT_PX / 2, 0, -FOCAL_PX, CAMERA_M * FOCAL_PX], [1, 0, 0, 0]], np.float32
)
"""A camera at a height of 1.5 m that looks along x."""


def images(color: tuple[int, int, int], depth_m: float) -> Images:
    rgb = np.full((1, HEIGHT_PX, WIDTH_PX, 3), color, np.uint8)
    depth = np.full((1, HEIGHT_PX // 8, WIDTH_PX // 8), depth_m, np.float32)
    return Images(rgb, depth, PROJECTION[None])


def box() -> AnyArray:
    boxes = np.zeros(1, BOX_DTYPE)
    boxes["x"], boxes["z"] = 12.0, 1.5
    boxes["length"], boxes["width"], boxes["height"] = 4.0, 4.0, 3.0
    return boxes


@pytest.fixture
def donor() -> Images:
    """All red at 10 m: the front of the box; right of the middle something stands before it, white at 5 m."""
    donor = images(RED, 10.0)
    donor.rgb[0, :, 96:] = 255
    donor.depth_m[0, :, 12:] = 5.0
    return donor


def red(pasted: Images) -> AnyArray:
    """(H, W) which pixels are red."""
    return (pasted.rgb[0] == RED).all(2)


def test_own_pixels_come_with_their_depth(donor: Images) -> None:
    pasted = paste_images(images(GRAY, 50.0), donor, box(), np.zeros(1))
    row, column = np.nonzero(red(pasted))
    # The front is 4 m wide and 3 m high at 10 m, so 40 by 30 pixels around the middle; what is white hides the right.
    assert (column.min(), column.max()) == (60, 95)
    assert (row.min(), row.max()) == pytest.approx((25, 55), abs=1)
    assert not (pasted.rgb == 255).any()
    assert set(pasted.depth_m[0, 4, 8:12]) == {10.0}
    assert set(pasted.depth_m[0, 4, 12:]) == {50.0}


def test_a_higher_stand_moves_the_pixels_up(donor: Images) -> None:
    flat, raised = (paste_images(images(GRAY, 50.0), donor, box(), np.array([step])) for step in (0.0, 0.6))
    assert np.nonzero(red(flat))[0].min() - np.nonzero(red(raised))[0].min() == 5  # 0.6 m at 12 m


def test_nearer_things_stay_in_front(donor: Images) -> None:
    sample = images(GRAY, 50.0)
    sample.depth_m[0, :, :9] = 6.0
    pasted = paste_images(sample, donor, box(), np.zeros(1))
    assert np.nonzero(red(pasted))[1].min() == 72
    assert (pasted.depth_m[0, :, :9] == 6.0).all()


def test_an_object_behind_the_camera_changes_nothing(donor: Images) -> None:
    behind = box()
    behind["x"] = -12.0
    pasted = paste_images(images(GRAY, 50.0), donor, behind, np.zeros(1))
    np.testing.assert_array_equal(pasted.rgb, images(GRAY, 50.0).rgb)
