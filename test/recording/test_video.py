"""Video of color images: what players of H.264 find in it, the same bytes again, and images at any place of it."""

import io
import itertools
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import av
import numpy as np
import pytest
from av.video.frame import PictureType

from simbev_ros.foundation.errors import BagError
from simbev_ros.recording.video import KEY_FRAME_INTERVAL, VideoCursor, VideoEncoder, VideoStream, is_key_frame

WIDTH, HEIGHT, COUNT = 98, 66, 2 * KEY_FRAME_INTERVAL + 5
SPS, PPS, SLICE, KEY_SLICE = 7, 8, 1, 5


def images() -> list[np.ndarray]:
    """A smooth picture in color that moves by two pixels from image to image."""
    rows, columns = np.mgrid[:HEIGHT, : WIDTH + 2 * COUNT]
    waves = [np.sin(columns / 9.0), np.cos(rows / 11.0), np.sin((rows + columns) / 15.0)]
    wide = np.stack([128 + 90 * wave for wave in waves], axis=2).astype(np.uint8)
    return [wide[:, 2 * index : 2 * index + WIDTH] for index in range(COUNT)]


@pytest.fixture(scope="module")
def units() -> list[bytes]:
    encoder = VideoEncoder(WIDTH, HEIGHT)
    return [encoder.encode(image) for image in images()]


def nal_types(unit: bytes) -> list[int]:
    return [part[0] & 31 for part in unit.split(b"\0\0\1")[1:]]


def test_a_player_decodes_one_image_of_each_message_in_order_without_b_frames(units: list[bytes]) -> None:
    with av.open(io.BytesIO(b"".join(units)), format="h264") as container:
        stream = container.streams.video[0]
        stream.thread_type = "NONE"
        frames = list(container.decode(stream))
    assert len(frames) == COUNT
    assert (frames[0].width, frames[0].height) == (WIDTH, HEIGHT)
    expected = [PictureType.P if index % KEY_FRAME_INTERVAL else PictureType.I for index in range(COUNT)]
    assert [frame.pict_type for frame in frames] == expected


def test_key_frames_come_at_the_start_and_regularly_with_parameter_sets(units: list[bytes]) -> None:
    for index, unit in enumerate(units):
        found = nal_types(unit)
        is_key = index % KEY_FRAME_INTERVAL == 0
        assert is_key_frame(unit) == is_key
        assert found.count(KEY_SLICE if is_key else SLICE) == 1
        assert ({SPS, PPS} <= {*found}) == is_key
        assert unit.startswith((b"\0\0\0\1", b"\0\0\1"))


def test_the_same_images_give_the_same_bytes_whichever_threads_encode_them(units: list[bytes]) -> None:
    stream = VideoStream(WIDTH, HEIGHT)
    turns = [stream.announce() for _ in range(COUNT)]
    with ThreadPoolExecutor(COUNT) as pool:
        futures = [pool.submit(turn, image) for turn, image in [*zip(turns, images(), strict=True)][::-1]][::-1]
        assert [future.result() for future in futures] == units


def test_images_are_close_to_those_that_were_encoded(units: list[bytes]) -> None:
    cursor = VideoCursor()
    for index, image in enumerate(images()):
        decoded = cursor.image(index, units.__getitem__)
        error = decoded.astype(float) - image
        assert decoded.dtype == np.uint8
        assert 10 * np.log10(255.0**2 / np.mean(error**2)) > 35
        assert np.abs(error.mean(axis=(0, 1))).max() < 1.5  # no shift of a color


def test_images_at_any_place_are_those_of_the_whole_video_in_order(units: list[bytes]) -> None:
    cursor = VideoCursor()
    whole = [cursor.image(index, units.__getitem__) for index in range(COUNT)]
    other = VideoCursor()
    for index in (COUNT - 1, 3, 4, 2, 2, 21, 19, 40, 25):
        assert np.array_equal(other.image(index, units.__getitem__), whole[index])


def test_each_message_is_read_once_in_order_and_from_the_key_frame_elsewhere(units: list[bytes]) -> None:
    read: list[int] = []
    cursor = VideoCursor()

    def get(index: int) -> bytes:
        read.append(index)
        return units[index]

    for index in range(5):
        cursor.image(index, get)
    assert read == [0, 1, 2, 3, 4]
    read.clear()
    cursor.image(KEY_FRAME_INTERVAL + 2, get)
    assert sorted(read) == [KEY_FRAME_INTERVAL + step for step in range(3)]


def test_a_video_that_begins_without_a_key_frame_is_refused(units: list[bytes]) -> None:
    with pytest.raises(BagError, match="without a key frame up to image 2"):
        VideoCursor().image(2, units[1:].__getitem__)


@pytest.mark.parametrize("damage", [b"", b"\0\0\1", b"\0\0\1\x65\xff", bytes(50), b"\0\0\0\1\x67\x64\0\x0a"])
def test_damaged_images_are_refused_and_the_next_ones_are_read(units: list[bytes], damage: bytes) -> None:
    cursor = VideoCursor()
    with pytest.raises(BagError, match="image 0"):
        cursor.image(0, [damage].__getitem__)
    assert cursor.image(1, units.__getitem__).shape == (HEIGHT, WIDTH, 3)


def test_a_cut_off_key_frame_never_gives_another_error(units: list[bytes]) -> None:
    for end, flip in itertools.product(range(0, len(units[0]), 97), (0, 255)):
        damaged = bytearray(units[0])[:end] + bytes([flip])
        with suppress(BagError):
            VideoCursor().image(0, [bytes(damaged)].__getitem__)
