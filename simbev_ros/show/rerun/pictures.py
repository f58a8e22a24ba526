"""Compressed pictures: JPEG and PNG of messages as they are, and pictures of labels as PNG with a palette."""

import struct
import zlib
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from simbev_ros.foundation.types import AnyArray, BoolArray, UInt8Array
from simbev_ros.recording.arrays import image_array
from simbev_ros.recording.image_codecs import encode_labels, encode_rgb

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_HEADER_END = len(_SIGNATURE) + 25
"""Length of the signature and of the first chunk, which is the header."""
_COLOR_TYPE_AT = len(_SIGNATURE) + 17
_INDEXED = 3


def color_jpeg(message: Any, step: int, decode: Callable[[Any], AnyArray] = image_array) -> bytes:
    """JPEG of a color image, made smaller by a step; a recorded JPEG is taken as it is if the step is 1."""
    if step == 1 and "jpeg" in getattr(message, "format", ""):
        return bytes(message.data)
    image = np.asarray(decode(message), np.uint8)
    height_px, width_px = every_pixel(image, step).shape[:2]
    smaller = cv2.resize(image, (width_px, height_px), interpolation=cv2.INTER_AREA)
    return encode_rgb(np.asarray(smaller, np.uint8))


def every_pixel(image: AnyArray, step: int) -> AnyArray:
    """One in ``step`` pixels of an (H, W, …) image in each direction: those in the middle."""
    return image[step // 2 :: step, step // 2 :: step]


def with_palette(png: bytes, colors: UInt8Array) -> bytes:
    """Color the gray levels of a PNG; its pixels are not decoded.

    Args:
        png: Of 8 bits, gray, without transparency.
        colors: (N, 3) or (N, 4) colors, 0..255, of the lowest gray levels; N is at most 256. The fourth column is the
            opacity.
    """
    header = bytearray(png[len(_SIGNATURE) + 4 : _HEADER_END - 4])
    header[_COLOR_TYPE_AT - len(_SIGNATURE) - 4] = _INDEXED
    chunks = [_chunk(bytes(header)), _chunk(b"PLTE" + colors[:, :3].tobytes())]
    if colors.shape[1] == 4:
        chunks.append(_chunk(b"tRNS" + colors[:, 3].tobytes()))
    return b"".join([_SIGNATURE, *chunks, png[_HEADER_END:]])


def mask_picture(mask: BoolArray, color: tuple[int, int, int]) -> bytes:
    """PNG of an (H, W) mask: one color where it is set, transparent elsewhere."""
    return with_palette(encode_labels(mask.astype(np.uint8)), np.array([(0, 0, 0, 0), (*color, 255)], np.uint8))


def _chunk(content: bytes) -> bytes:
    """A chunk of a PNG from its kind and data."""
    return struct.pack(">I", len(content) - 4) + content + struct.pack(">I", zlib.crc32(content))
