"""Pictures that the viewer is given, read with other decoders than those of the recording."""

from io import BytesIO

import cv2
import numpy as np
import pytest
from PIL import Image
from ros_messages import message

pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")

from simbev_ros.foundation.types import UInt8Array
from simbev_ros.recording.image_codecs import compressed_format, encode_image, encode_labels
from simbev_ros.show.rerun.pictures import color_jpeg, every_pixel, mask_picture, with_palette

SIZES = [(900, 1600), (24, 32), (25, 33), (7, 9), (3, 2)]


def ramp(height_px: int, width_px: int) -> UInt8Array:
    """An image whose red grows to the right and whose green grows downward."""
    rows, columns = np.indices((height_px, width_px))
    image = [columns * 255 // width_px, rows * 255 // height_px, np.full_like(rows, 90)]
    return np.stack(image, axis=2).astype(np.uint8)


def compressed(image: UInt8Array) -> object:
    """A recorded color image."""
    data = np.frombuffer(encode_image("rgb8", image), np.uint8)
    return message("sensor_msgs/msg/CompressedImage", header=None, format=compressed_format("rgb8"), data=data)


def raw(image: UInt8Array) -> object:
    """A color image as it is published."""
    height_px, width_px, _ = image.shape
    return message(
        "sensor_msgs/msg/Image",
        header=None,
        height=height_px,
        width=width_px,
        encoding="rgb8",
        is_bigendian=0,
        step=3 * width_px,
        data=image.ravel(),
    )


@pytest.mark.parametrize("channels", [3, 4])
def test_a_palette_colors_gray_levels(channels: int) -> None:
    rng = np.random.default_rng(channels)
    levels = rng.integers(0, 256, (21, 35)).astype(np.uint8)
    colors = rng.integers(0, 256, (256, channels)).astype(np.uint8)
    with Image.open(BytesIO(with_palette(encode_labels(levels), colors))) as picture:
        picture.load()
        assert (picture.format, picture.mode) == ("PNG", "P")
        shown = np.asarray(picture.convert("RGBA" if channels == 4 else "RGB"))
    np.testing.assert_array_equal(shown, colors[levels])


def test_a_palette_may_have_only_the_lowest_levels() -> None:
    levels = np.array([[0, 1, 2], [2, 1, 0]], np.uint8)
    colors = np.array([(10, 20, 30), (250, 0, 5), (7, 8, 9)], np.uint8)
    decoded = cv2.imdecode(np.frombuffer(with_palette(encode_labels(levels), colors), np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    np.testing.assert_array_equal(decoded[..., ::-1], colors[levels])


def test_a_mask_is_opaque_only_where_it_is_set() -> None:
    mask = np.random.default_rng(1).random((13, 17)) < 0.3
    data = np.frombuffer(mask_picture(mask, (200, 100, 50)), np.uint8)
    decoded = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    assert decoded is not None
    np.testing.assert_array_equal(decoded[..., 3], np.where(mask, 255, 0))
    np.testing.assert_array_equal(decoded[mask][:, :3], np.full((mask.sum(), 3), (50, 100, 200)))


def test_a_recorded_image_of_full_size_is_passed_on_byte_for_byte() -> None:
    recorded = compressed(ramp(24, 32))
    assert color_jpeg(recorded, 1) == recorded.data.tobytes()  # type: ignore[attr-defined]


@pytest.mark.parametrize("kind", [compressed, raw])
def test_a_step_of_two_halves_the_size_and_keeps_the_picture(kind: type) -> None:
    image = ramp(120, 200)
    with Image.open(BytesIO(color_jpeg(kind(image), 2))) as picture:
        assert (picture.format, picture.size) == ("JPEG", (100, 60))
        shown = np.asarray(picture.convert("RGB")).astype(float)
    averages = image.reshape(60, 2, 100, 2, 3).mean(axis=(1, 3))
    assert np.abs(shown - averages).max() < 12 and np.abs(shown - averages).mean() < 2


def test_a_published_image_of_full_size_is_compressed() -> None:
    with Image.open(BytesIO(color_jpeg(raw(ramp(24, 32)), 1))) as picture:
        assert (picture.format, picture.size) == ("JPEG", (32, 24))


@pytest.mark.parametrize("size_px", SIZES)
@pytest.mark.parametrize("step", [1, 2, 3])
def test_colors_and_labels_have_the_same_size(size_px: tuple[int, int], step: int) -> None:
    image = ramp(*size_px)
    with Image.open(BytesIO(color_jpeg(raw(image), step))) as picture:
        width_px, height_px = picture.size
    assert every_pixel(image[..., 0], step).shape == (height_px, width_px)


def test_the_pixels_that_are_taken_are_those_in_the_middle() -> None:
    columns = np.tile(np.arange(9), (9, 1))
    np.testing.assert_array_equal(every_pixel(columns, 3)[0], [1, 4, 7])
