"""Codecs for the kinds of image, in formats that the standard image_transport plugins can decode.

| encoding | format | error |
|---|---|---|
| rgb8 | JPEG, by default with quality 90, 4:2:0 | that of JPEG |
| mono8, mono16, bayer_rggb8 | PNG | none |
| 32FC1 depth | compressed_depth_image_transport's: inverse depth as 16-bit PNG or as RVL | see ``encode_depth`` |
| 32FC2 flow | KITTI's: u, v, valid as 16-bit PNG | 1/128 px; values beyond ±512 px become invalid |

Decoding needs NumPy and small codecs; encoding depth and flow also needs OpenCV, which comes with the simulator.
"""

import struct
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import simplejpeg

from simbev_ros.config.scenario import DepthForm, Recording
from simbev_ros.foundation.errors import FOREIGN_ERRORS, BagError, LimitError
from simbev_ros.foundation.files.limits import MAX_IMAGE_SIDE_PX, require_unpacked_size
from simbev_ros.foundation.types import AnyArray, BoolArray, Float32Array, UInt8Array, UInt16Array
from simbev_ros.recording.png import RowFilter, decode_png, encode_png
from simbev_ros.recording.rvl import decode_rvl, encode_rvl

_JPEG_QUALITY, _DEPTH_FORM = Recording().jpeg_quality, Recording().depth
_DEPTH_HEAD = struct.Struct("<iff")  # compression kind, quantization parameters a and b: level = a / depth + b
_INVERSE_DEPTH = 0
_DEPTH_BYTES = np.dtype(np.float32).itemsize
_RVL_SIZE = struct.Struct("<II")  # width and height
_MAX_LEVEL = 65535
_FLOW_UNITS_PER_PX = 64.0
_FLOW_ZERO = 32768
_FLOW_RANGE = ((-0.5,) * 2, (np.nextafter(np.float32(_MAX_LEVEL + 0.5), np.float32(0)).item(),) * 2)
"""Lowest and highest u and v, in these units, that round to 16 bits."""
_FLOW_VALID_PX = 511.0
"""Up to here all flow is valid, so that the range need not be looked at pixel by pixel."""


def encode_rgb(image: UInt8Array, quality: int = _JPEG_QUALITY) -> bytes:
    """JPEG of an (H, W, 3) uint8 RGB image; quality from 1 to 100."""
    return simplejpeg.encode_jpeg(
        np.ascontiguousarray(image), quality=quality, colorspace="RGB", colorsubsampling="420"
    )


def decode_rgb(data: bytes) -> UInt8Array:
    """(H, W, 3) uint8 RGB image decoded from a JPEG.

    Raises:
        ValueError: It is not a JPEG, damaged, or larger than any camera's image.
    """
    try:
        height_px, width_px, *_ = simplejpeg.decode_jpeg_header(data)
    except KeyError as error:  # how it looks the subsampling up
        raise ValueError(f"chroma subsampling of unknown kind {error}") from None
    _require_size(width_px, height_px)
    return simplejpeg.decode_jpeg(data, colorspace="RGB")


def encode_labels(image: AnyArray) -> bytes:
    """Lossless PNG of an (H, W) uint8 or uint16 image."""
    return encode_png(image, RowFilter.NONE)


def decode_labels(data: bytes) -> AnyArray:
    """(H, W) uint8 or uint16 image decoded from a PNG."""
    return decode_png(data, 1, 8, 16)


def encode_depth(depth_m: Float32Array, form: DepthForm = _DEPTH_FORM) -> bytes:
    """Inverse depth in 65535 even levels between the farthest and the nearest pixel of the image, as PNG or RVL.

    The format is that of compressed_depth_image_transport, which reads the quantization parameters from the
    header. There they are fixed for indoor cameras; here they follow the image. With ``near`` and ``far`` as extreme
    depths (``far`` at least twice ``near``), the error at depth d is at most d² (1/near - 1/far) / 131068, plus
    float32's 1e-6 d: with near = 2 m that is 1 cm at 50 m and 4 cm at 100 m.

    Args:
        depth_m: (H, W) float32, meters, > 0; values that are not finite (sky) become level 0.
        form: Lossless compression of the levels.

    Raises:
        ValueError: A depth is not positive.
    """
    finite = np.isfinite(depth_m)
    parameters = _depth_parameters(depth_m, finite)
    levels = parameters[0] / depth_m
    levels += parameters[1]
    levels = np.maximum(np.rint(levels, out=levels), 1, out=levels).astype(np.uint16)
    np.multiply(levels, finite, out=levels)
    head = _DEPTH_HEAD.pack(_INVERSE_DEPTH, *parameters.tolist())
    if form == "rvl":
        return head + _RVL_SIZE.pack(*levels.shape[::-1]) + encode_rvl(levels)
    return head + encode_png(levels, RowFilter.UP)


def _depth_parameters(depth_m: Float32Array, finite: BoolArray) -> Float32Array:
    """The parameters a and b with which the farthest depth is level 1 and the nearest one the last level."""
    if not finite.any():
        return np.ones(2, np.float32)
    import cv2

    near_m, far_m, _, _ = cv2.minMaxLoc(depth_m, finite.view(np.uint8))
    if near_m <= 0:
        raise ValueError(f"depth must be positive, not {near_m} m")
    far_m = max(far_m, 2 * near_m)
    scale = (_MAX_LEVEL - 1) / (1 / near_m - 1 / far_m)
    return np.array([scale, 1 - scale / far_m], np.float32)


def decode_depth(data: bytes) -> Float32Array:
    """(H, W) float32 depth in meters; +inf where the image had none (the standard decoder gives NaN there)."""
    return _depth_of(decode_png(data[_DEPTH_HEAD.size :], 1, 16), data)


def decode_rvl_depth(data: bytes) -> Float32Array:
    """The same of an image with levels in RVL.

    Raises:
        ValueError: It is damaged, larger than any camera's image, or beyond ``limits.max_unpacked_bytes``.
    """
    width_px, height_px = _RVL_SIZE.unpack_from(data, _DEPTH_HEAD.size)
    _require_size(width_px, height_px)
    if min(width_px, height_px) < 1:
        raise ValueError("it has no pixels")
    require_unpacked_size(_DEPTH_BYTES * width_px * height_px)
    levels = decode_rvl(data[_DEPTH_HEAD.size + _RVL_SIZE.size :], width_px * height_px)
    return _depth_of(levels.reshape(height_px, width_px), data)


def _depth_of(levels: UInt16Array, data: bytes) -> Float32Array:
    """Depth of (H, W) levels, with the parameters at the beginning of the data."""
    _, scale, offset = _DEPTH_HEAD.unpack_from(data)
    depth_m: Float32Array = levels - np.float32(offset)
    with np.errstate(divide="ignore"):  # level 0 means no depth and is overwritten below
        np.divide(np.float32(scale), depth_m, out=depth_m)
    depth_m[levels == 0] = np.inf
    return depth_m


def encode_flow(flow_px: Float32Array) -> bytes:
    """PNG with channels u, v and valid; u and v in 1/64 px from 2^15, valid 0 or 1.

    Args:
        flow_px: (H, W, 2) float32, pixels; invalid where NaN or outside the range of 16 bits.
    """
    import cv2

    # Few calls that are long: between calls, each of the encoding threads waits for Python's lock. OpenCV rounds and
    # saturates in one pass, where NumPy needs four.
    levels = cv2.addWeighted(flow_px, _FLOW_UNITS_PER_PX, flow_px, 0.0, _FLOW_ZERO, dtype=cv2.CV_16U)
    image = np.ones((*levels.shape[:2], 3), np.uint16)
    if not -_FLOW_VALID_PX <= flow_px.min() <= flow_px.max() <= _FLOW_VALID_PX:  # also if one is NaN
        invalid = cv2.inRange(flow_px * _FLOW_UNITS_PER_PX + _FLOW_ZERO, *_FLOW_RANGE) == 0
        levels[invalid] = image[invalid] = 0
    cv2.mixChannels([levels], [image], (0, 0, 1, 1))  # much faster than NumPy at images of few channels
    return encode_png(image, RowFilter.UP)


def decode_flow(data: bytes) -> Float32Array:
    """(H, W, 2) float32 flow in pixels, NaN where invalid."""
    image = decode_png(data, 3, 16)
    flow_px: Float32Array = image[..., :2].astype(np.float32)
    flow_px -= np.float32(_FLOW_ZERO)
    flow_px *= np.float32(1 / _FLOW_UNITS_PER_PX)
    valid = image[..., 2] != 0
    if not valid.all():
        flow_px[~valid] = np.nan
    return flow_px


class _Codec(NamedTuple):
    """Codec of one kind of image, with the name of its format in ``CompressedImage.format``."""

    format: str
    encode: Callable[[AnyArray], bytes]
    decode: Callable[[bytes], AnyArray]


_CODECS = {
    "rgb8": _Codec("rgb8; jpeg compressed bgr8", encode_rgb, decode_rgb),
    "mono8": _Codec("mono8; png compressed", encode_labels, decode_labels),
    "mono16": _Codec("mono16; png compressed", encode_labels, decode_labels),
    "bayer_rggb8": _Codec("bayer_rggb8; png compressed", encode_labels, decode_labels),
    "32FC1": _Codec("32FC1; compressedDepth png", encode_depth, decode_depth),
    "32FC2": _Codec("rgb16; png compressed bgr16", encode_flow, decode_flow),
}
_RVL_FORMAT = "32FC1; compressedDepth rvl"
_DECODERS = {**{codec.format: codec.decode for codec in _CODECS.values()}, _RVL_FORMAT: decode_rvl_depth}


def compressed_format(encoding: str, depth: DepthForm = _DEPTH_FORM) -> str:
    """Value of ``CompressedImage.format`` for images of a ROS encoding."""
    return _RVL_FORMAT if (encoding, depth) == ("32FC1", "rvl") else _CODECS[encoding].format


def encode_image(
    encoding: str, image: AnyArray, jpeg_quality: int = _JPEG_QUALITY, depth: DepthForm = _DEPTH_FORM
) -> bytes:
    """Compress an image of a ROS encoding to the value of ``CompressedImage.data``."""
    if encoding == "rgb8":
        return encode_rgb(image, jpeg_quality)
    if encoding == "32FC1":
        return encode_depth(image, depth)
    return _CODECS[encoding].encode(image)


def decode_image(image_format: str, data: bytes) -> AnyArray:
    """Decode the image of a ``CompressedImage``.

    Raises:
        BagError: The format is unknown, or the data cannot be decoded.
    """
    if image_format not in _DECODERS:
        raise BagError(f"compressed image of unknown format {image_format!r}")
    try:
        return _DECODERS[image_format](data)
    except FOREIGN_ERRORS as error:
        raise BagError(f"compressed image of format {image_format!r} cannot be decoded: {error}") from None


def _require_size(width_px: int, height_px: int) -> None:
    if max(width_px, height_px) > MAX_IMAGE_SIDE_PX:
        raise LimitError(f"it has {width_px} x {height_px} pixels; at most {MAX_IMAGE_SIDE_PX} a side are decoded")
