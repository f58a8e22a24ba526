"""PNGs against two other implementations: OpenCV's and Pillow's."""

import io
import struct
import zlib
from collections.abc import Callable

import cv2
import numpy as np
import pytest
from PIL import Image

from simbev_ros.foundation.types import AnyArray
from simbev_ros.recording.png import RowFilter, decode_png, encode_png

RNG = np.random.default_rng(4)
SHAPES = [(45, 80), (45, 80, 3), (1, 1), (1, 7, 3), (300, 1)]
TYPES = [np.uint8, np.uint16]


def image_of(shape: tuple[int, ...], dtype: type[np.uint8 | np.uint16]) -> AnyArray:
    """Noise beside a flat and a smooth area."""
    image = RNG.integers(0, np.iinfo(dtype).max, shape, dtype, endpoint=True)
    image[:, : shape[1] // 3] = 7
    image[:, shape[1] // 2 :] = np.arange(shape[0], dtype=dtype).reshape(-1, *(1 for _ in shape[1:]))
    return image


def channels_of(image: AnyArray) -> int:
    return 1 if image.ndim == 2 else 3


@pytest.mark.parametrize("row_filter", RowFilter)
@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("shape", SHAPES)
def test_opencv_reads_what_is_written(
    shape: tuple[int, ...], dtype: type[np.uint8 | np.uint16], row_filter: RowFilter
) -> None:
    image = image_of(shape, dtype)
    data = encode_png(image, row_filter)
    read = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert read is not None and read.dtype == dtype
    assert np.array_equal(read if image.ndim == 2 else read[..., ::-1], image)
    again = decode_png(data, channels_of(image), 8, 16)
    assert again.dtype == dtype and np.array_equal(again, image)
    if not (image.ndim == 3 and dtype is np.uint16):  # which Pillow reads with 8 bits
        assert np.array_equal(np.asarray(Image.open(io.BytesIO(data))), image)


def opencv(image: AnyArray) -> bytes:
    return cv2.imencode(".png", image if image.ndim == 2 else image[..., ::-1])[1].tobytes()


def opencv_adaptive(image: AnyArray) -> bytes:
    settings = (cv2.IMWRITE_PNG_COMPRESSION, 6)
    return cv2.imencode(".png", image if image.ndim == 2 else image[..., ::-1], settings)[1].tobytes()


def pillow(image: AnyArray) -> bytes:
    file = io.BytesIO()
    Image.fromarray(image).save(file, "png")
    return file.getvalue()


@pytest.mark.parametrize("encode", [opencv, opencv_adaptive, pillow])
@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("shape", SHAPES)
def test_what_others_write_is_read(
    shape: tuple[int, ...], dtype: type[np.uint8 | np.uint16], encode: Callable[[AnyArray], bytes]
) -> None:
    image = image_of(shape, dtype)
    if encode is pillow and dtype is np.uint16:  # it writes gray ones only
        image = np.ascontiguousarray(image.reshape(*shape[:2], -1)[..., 0])
    read = decode_png(encode(image), channels_of(image), 8, 16)
    assert read.dtype == dtype and np.array_equal(read, image)


def png(rows: bytes, width_px: int, height_px: int) -> bytes:
    """A PNG of 8 bits from filtered rows, in two data chunks."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width_px, height_px, 8, 0, 0, 0, 0)
    packed = zlib.compress(rows)
    body = chunk(b"tEXt", b"comment\0made up") + chunk(b"IDAT", packed[:5]) + chunk(b"IDAT", packed[5:])
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + body + chunk(b"IEND", b"")


def test_rows_may_be_filtered_differently() -> None:
    rows = bytes([2, 1, 2, 3]) + bytes([2, 1, 1, 255]) + bytes([0, 9, 8, 7]) + bytes([2, 250, 0, 0])
    expected = [[1, 2, 3], [2, 3, 2], [9, 8, 7], [3, 8, 7]]
    assert decode_png(png(rows, 3, 4), 1, 8).tolist() == expected
    with_left = rows + bytes([1, 5, 1, 1])
    assert decode_png(png(with_left, 3, 5), 1, 8).tolist() == [*expected, [5, 6, 7]]


def test_damage_is_refused() -> None:
    whole = encode_png(image_of((20, 30), np.uint8), RowFilter.UP)
    for position in range(len(whole)):
        damaged = bytearray(whole)
        damaged[position] ^= 4
        with pytest.raises(ValueError):
            decode_png(bytes(damaged), 1, 8)
    for length in range(len(whole)):
        with pytest.raises(ValueError):
            decode_png(whole[:length], 1, 8)


@pytest.mark.parametrize("size", [(0, 3), (3, 0), (0, 0)])
def test_images_without_pixels_are_refused_before_anything_is_unpacked(size: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="no pixels"):
        decode_png(png(bytes(1 << 20), *size), 1, 8)


def test_too_few_rows_are_refused() -> None:
    with pytest.raises(ValueError, match="too few pixels"):
        decode_png(png(bytes(8), 3, 3), 1, 8)
