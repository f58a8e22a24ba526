import struct
import zlib

import cv2
import numpy as np
import pytest

from simbev_ros.config.scenario import DepthForm
from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.files.limits import MAX_UNPACKED_VARIABLE
from simbev_ros.recording.image_codecs import compressed_format, decode_image, encode_image
from simbev_ros.recording.rvl import decode_rvl

RNG = np.random.default_rng(3)


def test_rgb_keeps_the_order_of_channels_and_is_close() -> None:
    image = np.zeros((64, 96, 3), np.uint8)
    image[...] = [200, 100, 30]
    image[20:40, 30:60] = [10, 90, 240]
    read = decode_image(compressed_format("rgb8"), encode_image("rgb8", image))
    assert np.abs(read.astype(int) - image)[[5, 30], [5, 45]].max() <= 3
    opened = cv2.imdecode(np.frombuffer(encode_image("rgb8", image), np.uint8), cv2.IMREAD_COLOR)
    assert np.abs(opened[5, 5].astype(int) - [30, 100, 200]).max() <= 3


def test_jpegs_are_smaller_and_worse_at_lower_quality() -> None:
    image = RNG.integers(0, 255, (64, 96, 3), np.uint8)
    forms = [encode_image("rgb8", image, quality) for quality in (40, 90, 98)]
    assert [len(form) for form in forms] == sorted(len(form) for form in forms)
    errors = [np.abs(decode_image(compressed_format("rgb8"), form).astype(int) - image).mean() for form in forms]
    assert errors == sorted(errors, reverse=True)
    assert encode_image("rgb8", image) == forms[1]


@pytest.mark.parametrize(("encoding", "dtype"), [("mono8", np.uint8), ("mono16", np.uint16)])
def test_labels_are_lossless(encoding: str, dtype: type[np.uint8 | np.uint16]) -> None:
    image = RNG.integers(0, np.iinfo(dtype).max, (45, 80), dtype, endpoint=True)
    read = decode_image(compressed_format(encoding), encode_image(encoding, image))
    assert read.dtype == dtype
    assert np.array_equal(read, image)


def depth_image(near_m: float, far_m: float) -> np.ndarray:
    depth_m = np.geomspace(near_m, far_m, 45 * 80).reshape(45, 80).astype(np.float32)
    depth_m[:9] = np.inf
    return depth_m


@pytest.mark.parametrize("form", ["png", "rvl"])
@pytest.mark.parametrize(("near_m", "far_m"), [(0.1, 1000.0), (2.0, 300.0), (10.0, 11.0), (5.0, 5.0)])
def test_depth_error_is_within_the_documented_bound(near_m: float, far_m: float, form: DepthForm) -> None:
    depth_m = depth_image(near_m, far_m)
    read = decode_image(compressed_format("32FC1", form), encode_image("32FC1", depth_m, depth=form))
    assert read.dtype == np.float32
    assert np.array_equal(np.isinf(read), np.isinf(depth_m))
    seen = np.isfinite(depth_m)
    true_m = depth_m[seen].astype(np.float64)
    near, far = true_m.min(), max(true_m.max(), 2 * true_m.min())
    bound_m = true_m**2 * (1 / near - 1 / far) / 131068 + 1e-6 * true_m
    assert (np.abs(read[seen] - true_m) <= bound_m * 1.02).all()


def test_the_error_of_depth_on_a_street_is_below_a_thousandth() -> None:
    """The nearest road surface that a camera on a car sees is 2 m away."""
    image = depth_image(2.0, 2000.0)
    read_m = decode_image(compressed_format("32FC1"), encode_image("32FC1", image))[9:]
    depth_m = image[9:]
    error_m = np.abs(read_m - depth_m)
    for within_m, most_m in ((50.0, 0.011), (100.0, 0.04), (250.0, 0.25)):
        assert error_m[depth_m < within_m].max() <= min(most_m, within_m / 1000.0)


def test_the_standard_decoder_reads_the_same_depth() -> None:
    """The decoder's formula, from the package's documentation: depth = a / (level - b), in float32, level 0 unknown."""
    depth_m = depth_image(2.0, 300.0)
    data = encode_image("32FC1", depth_m)
    kind, a, b = struct.unpack("<iff", data[:12])
    levels = cv2.imdecode(np.frombuffer(data[12:], np.uint8), cv2.IMREAD_UNCHANGED)
    assert (kind, levels.dtype, levels.shape) == (0, np.uint16, (45, 80))
    assert compressed_format("32FC1") == "32FC1; compressedDepth png"
    assert (levels[:9] == 0).all() and (levels[9:] > 0).all()
    stock_m = np.float32(a) / (levels[9:].astype(np.float32) - np.float32(b))
    assert np.allclose(stock_m, depth_m[9:], rtol=2e-3)


@pytest.mark.parametrize("form", ["png", "rvl"])
def test_depth_of_only_sky_stays_sky(form: DepthForm) -> None:
    sky = np.full((8, 9), np.inf, np.float32)
    read = decode_image(compressed_format("32FC1", form), encode_image("32FC1", sky, depth=form))
    assert np.isinf(read).all() and read.shape == (8, 9)


def test_rvl_has_the_levels_of_the_png_behind_width_and_height() -> None:
    """As codec.cpp of compressed_depth_image_transport writes them: configuration, columns, rows, stream."""
    depth_m = depth_image(2.0, 300.0)
    png, rvl = encode_image("32FC1", depth_m), encode_image("32FC1", depth_m, depth="rvl")
    assert compressed_format("32FC1", "rvl") == "32FC1; compressedDepth rvl"
    assert rvl[:12] == png[:12] and struct.unpack_from("<II", rvl, 12) == (80, 45)
    levels = cv2.imdecode(np.frombuffer(png[12:], np.uint8), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(decode_rvl(rvl[20:], 45 * 80), levels.ravel())


def test_an_rvl_image_larger_than_any_camera_or_without_pixels_is_refused() -> None:
    for width_px, height_px, problem in ((8193, 2, "it has 8193 x 2 pixels"), (0, 4, "it has no pixels")):
        data = bytes(12) + struct.pack("<II", width_px, height_px) + bytes(8)
        with pytest.raises(BagError, match=problem):
            decode_image("32FC1; compressedDepth rvl", data)


def test_an_rvl_image_beyond_what_may_be_unpacked_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(MAX_UNPACKED_VARIABLE, "1")
    with pytest.raises(BagError, match="1 MiB"):
        decode_image("32FC1; compressedDepth rvl", bytes(12) + struct.pack("<II", 1000, 1000) + bytes(8))


def test_depth_that_is_not_positive_is_refused() -> None:
    depth_m = np.ones((8, 8), np.float32)
    depth_m[3, 3] = 0
    with pytest.raises(ValueError, match=r"depth must be positive, not 0\.0 m"):
        encode_image("32FC1", depth_m)


def test_flow_is_within_half_a_step_and_keeps_invalid_pixels() -> None:
    flow_px = RNG.uniform(-511, 511, (45, 80, 2)).astype(np.float32)
    flow_px[3, 5] = np.nan
    flow_px[4, 6, 1] = 513
    read = decode_image(compressed_format("32FC2"), encode_image("32FC2", flow_px))
    invalid = np.isnan(read)
    assert np.argwhere(invalid.any(-1)).tolist() == [[3, 5], [4, 6]]
    assert invalid[3, 5].all() and invalid[4, 6].all()
    assert np.abs(read - flow_px)[~invalid].max() <= 1 / 128 + 1e-4


def test_flow_png_has_kittis_channels_in_order_u_v_valid() -> None:
    flow_px = np.full((4, 4, 2), [1.5, -2.0], np.float32)
    flow_px[0, 0] = np.nan
    png = cv2.imdecode(np.frombuffer(encode_image("32FC2", flow_px), np.uint8), cv2.IMREAD_UNCHANGED)
    red_green_blue = png[..., ::-1]
    assert red_green_blue[1, 1].tolist() == [32768 + 96, 32768 - 128, 1]
    assert red_green_blue[0, 0, 2] == 0


def test_damaged_data_are_a_bag_error() -> None:
    with pytest.raises(BagError, match="cannot be decoded"):
        decode_image(compressed_format("mono8"), b"not a png")


def huge_png(width_px: int, height_px: int) -> bytes:
    """A valid PNG of zeros, 16 bits a pixel, written without an image in memory."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    packer, rows = zlib.compressobj(), []
    for _ in range(height_px):
        rows.append(packer.compress(bytes(1 + 2 * width_px)))
    head = struct.pack(">IIBBBBB", width_px, height_px, 16, 0, 0, 0, 0)
    data = b"".join(rows) + packer.flush()
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


@pytest.mark.parametrize("encoding", ["mono8", "mono16", "32FC1", "32FC2"])
def test_a_png_larger_than_any_camera_is_refused(encoding: str) -> None:
    data = bytes(12 if encoding == "32FC1" else 0) + huge_png(8193, 2)
    with pytest.raises(BagError, match="it has 8193 x 2 pixels; at most 8192 a side are decoded"):
        decode_image(compressed_format(encoding), data)
    assert decode_image(compressed_format("mono16"), huge_png(8192, 2)).shape == (2, 8192)


def test_a_jpeg_larger_than_any_camera_is_refused() -> None:
    data = encode_image("rgb8", np.zeros((1, 8193, 3), np.uint8))
    with pytest.raises(BagError, match="it has 8193 x 1 pixels"):
        decode_image(compressed_format("rgb8"), data)


def test_a_jpeg_of_unknown_subsampling_is_refused() -> None:
    data = bytes.fromhex("ffd8ffc0001108000ffa1003011400021123031101ffda000c03010002110337000000")
    with pytest.raises(BagError, match="chroma subsampling of unknown kind 6"):
        decode_image(compressed_format("rgb8"), data)


def test_other_formats_are_not_decoded_as_png() -> None:
    done, data = cv2.imencode(".tiff", np.zeros((4, 4), np.uint8))
    assert done
    with pytest.raises(BagError, match="not a PNG"):
        decode_image(compressed_format("mono8"), data.tobytes())


def test_a_png_with_a_chunk_longer_than_its_data_is_refused_before_opencv_makes_room_for_it() -> None:
    data = bytearray(encode_image("mono16", np.zeros((2, 3), np.uint16)))
    start = data.index(b"IDAT") - 4
    data[start : start + 4] = struct.pack(">I", 0xF8000000)
    with pytest.raises(BagError, match="a chunk has a wrong length"):
        decode_image(compressed_format("mono16"), bytes(data))


def test_a_png_with_more_pixels_than_its_bytes_can_hold_is_refused() -> None:
    head = b"IHDR" + struct.pack(">II", 8192, 8192) + b"\x10\0\0\0\0"
    end = bytes(4) + b"IEND" + struct.pack(">I", zlib.crc32(b"IEND"))
    data = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + head + struct.pack(">I", zlib.crc32(head)) + end
    with pytest.raises(BagError, match="0 bytes cannot hold 8192 x 8192 pixels"):
        decode_image(compressed_format("mono16"), data)


def test_a_png_of_another_pixel_type_is_refused() -> None:
    color = encode_image("32FC2", np.zeros((2, 3, 2), np.float32))
    with pytest.raises(BagError, match="16 bits and color type 2"):
        decode_image(compressed_format("mono16"), color)
