"""Video of color images: H.264 as ``foxglove_msgs/CompressedVideo`` has it, one message an image, without B frames.

Images enter in the order of time and leave as access units in Annex B; equal images give equal bytes. The libraries
are loaded when the first image is encoded or decoded, as reading a dataset without video needs none of them.
"""

from collections.abc import Callable
from fractions import Fraction
from functools import partial
from threading import Condition, Lock
from typing import Any

import numpy as np

from simbev_ros.foundation.errors import FOREIGN_ERRORS, BagError, LimitError
from simbev_ros.foundation.files.limits import MAX_IMAGE_SIDE_PX
from simbev_ros.foundation.installation.extras import load_extras
from simbev_ros.foundation.types import UInt8Array

VIDEO_TYPE = "foxglove_msgs/msg/CompressedVideo"
H264 = "h264"
KEY_FRAME_INTERVAL = 20
"""Number of images from one key frame to the next: a player that starts anywhere waits for one second at 20 Hz."""

_QUALITY = "23"
"""Constant rate factor of x264, its default."""
_PARAMETERS = ":".join(
    (f"keyint={KEY_FRAME_INTERVAL}", f"min-keyint={KEY_FRAME_INTERVAL}", "scenecut=0", "cpu-independent=1")
)
"""Key frames at fixed distances, and bytes that do not depend on the processor."""
_BT709 = 1
"""Number of ITU-R BT.709 among color spaces, primaries and transfer characteristics (ISO/IEC 23091-2)."""
_START_CODE = b"\0\0\1"
_KEY_SLICE, _SLICES = 5, range(1, 6)
"""Types of NAL units (ITU-T H.264, table 7-1)."""
Encode = Callable[[UInt8Array], bytes]


class VideoEncoder:
    """Encodes the images of one camera, in the order of time.

    Args:
        width_px: Width of the images, even.
        height_px: Their height, even.
    """

    def __init__(self, width_px: int, height_px: int) -> None:
        import av
        from av.video.reformatter import ColorRange

        context: Any = av.CodecContext.create("libx264", "w")
        context.width, context.height, context.pix_fmt = width_px, height_px, "yuv420p"
        context.time_base = Fraction(1, KEY_FRAME_INTERVAL)
        context.thread_count = 1  # with other numbers the bytes are others
        context.color_range = ColorRange.MPEG
        context.colorspace = context.color_primaries = context.color_trc = _BT709
        # zerolatency: each image leaves before the next one enters, which excludes B frames.
        context.options = {
            "crf": _QUALITY,
            "preset": "veryfast",
            "tune": "zerolatency",
            "x264-params": _PARAMETERS,
        }
        self._context, self._images = context, 0

    def encode(self, image: UInt8Array) -> bytes:
        """Access unit of the next (H, W, 3) RGB image; it begins with the parameter sets if it is a key frame."""
        import av
        from av.video.reformatter import ColorRange, Colorspace

        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
        frame = frame.reformat(format="yuv420p", dst_colorspace=Colorspace.ITU709, dst_color_range=ColorRange.MPEG)
        frame.pts = self._images
        self._images += 1
        return b"".join(map(bytes, self._context.encode(frame)))


class VideoStream:
    """Video of one camera whose images threads encode, each in its turn.

    Args:
        width_px: Width of the images, even.
        height_px: Their height, even.
    """

    def __init__(self, width_px: int, height_px: int) -> None:
        self._encoder = VideoEncoder(width_px, height_px)
        self._announced = self._encoded = 0
        self._changed = Condition()

    def announce(self) -> Encode:
        """Give the next image its turn; the function that encodes it must be called, after those of earlier ones."""
        self._announced += 1
        return partial(self._encode, self._announced - 1)

    def _encode(self, turn: int, image: UInt8Array) -> bytes:
        with self._changed:
            self._changed.wait_for(lambda: self._encoded == turn)
            try:
                return self._encoder.encode(image)
            finally:
                self._encoded += 1
                self._changed.notify_all()


class VideoCursor:
    """Decodes images of one video, which is quick in the order of time; threads may share it.

    An image that does not follow the latest one is decoded from the key frame before it.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._decoder: Any = None
        self._next = -1

    def image(self, index: int, read: Callable[[int], bytes]) -> UInt8Array:
        """(H, W, 3) RGB image with an index in the video.

        Args:
            index: The index.
            read: Gives the data of the message with an index.

        Raises:
            BagError: The data cannot be decoded, or no key frame comes before the image.
            InputError: PyAV is not installed.
        """
        load_extras()["pictures"].require("decoding video")
        from av.error import FFmpegError

        with self._lock:
            units = [read(index)]
            while not is_key_frame(units[-1]) and (first := index - len(units) + 1) != self._next:
                if first == 0:
                    raise BagError(f"video without a key frame up to image {index}")
                units.append(read(first - 1))
            self._next = -1  # until all has been decoded
            try:
                image = self._decode(units[::-1])
            except (FFmpegError, *FOREIGN_ERRORS) as error:
                raise BagError(f"image {index} of the video cannot be decoded: {error!s:.200}") from None
            self._next = index + 1
            return image

    def _decode(self, units: list[bytes]) -> UInt8Array:
        """The image of the last one of successive access units, the first of which is a key frame or the next one."""
        import av
        from av.video.reformatter import ColorRange, Colorspace

        if is_key_frame(units[0]):
            self._decoder = av.CodecContext.create(H264, "r")
            self._decoder.thread_count = 1
        *_, frame = [frame for unit in units for frame in self._decoder.decode(av.Packet(unit))]
        if max(frame.width, frame.height) > MAX_IMAGE_SIDE_PX:
            raise LimitError(f"it has {frame.width} x {frame.height} pixels; at most {MAX_IMAGE_SIDE_PX} a side")
        rgb = frame.reformat(format="rgb24", src_colorspace=Colorspace.ITU709, src_color_range=ColorRange.MPEG)
        return np.asarray(rgb.to_ndarray(), np.uint8)


def is_key_frame(unit: bytes) -> bool:
    """Whether an access unit of H.264 in Annex B can be decoded without others."""
    at = unit.find(_START_CODE)
    while 0 <= at < len(unit) - len(_START_CODE):
        kind = unit[at + len(_START_CODE)] & 31
        if kind in _SLICES:
            return kind == _KEY_SLICE
        at = unit.find(_START_CODE, at + 1)
    return False
