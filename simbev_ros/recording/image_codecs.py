"""Codecs for the five kinds of image, in formats that the standard image_transport plugins can decode.

| encoding | format | error |
|---|---|---|
| rgb8 | JPEG, by default with quality 90, 4:2:0 | that of JPEG |
| mono8, mono16 | PNG | none |
| 32FC1 depth | compressed_depth_image_transport's: inverse depth as 16-bit PNG | see ``encode_depth`` |
| 32FC2 flow | KITTI's: u, v, valid as 16-bit PNG | 1/128 px; values beyond ±512 px become invalid |
"""

import struct
from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np
import simplejpeg

from simbev_ros.config.scenario import Recording
from simbev_ros.errors import BagError, LimitError
from simbev_ros.limits import MAX_IMAGE_SIDE_PX
from simbev_ros.types import AnyArray, Float32Array, UInt8Array

_JPEG_QUALITY = Recording().jpeg_quality
# Without a level, all versions of OpenCV use level 1 and the filter SUB. With a level, OpenCV chooses a filter for each
# row, which takes three times as long and gains little on these images, which are smooth or flat.
_PNG = (cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_DEFAULT)

_PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
_PNG_START = _PNG_MAGIC + b"\0\0\0\x0dIHDR"
_PNG_HEAD = struct.Struct(">IIBB")
"""Width, height, bits of a channel, and kind of color, after ``_PNG_START``."""
_PNG_LENGTH = struct.Struct(">I")
_PNG_CHUNK_BYTES = 12
"""Size of a chunk's length, kind and CRC, around its content."""
_GRAY, _COLOR = 0, 2
_CHANNELS = {_GRAY: 1, _COLOR: 3}
_MAX_DEFLATE_RATIO = 1032  # of zlib's format, https://zlib.net/zlib_tech.html
_DEPTH_HEAD = struct.Struct("<iff")  # compression kind, quantization parameters a and b: level = a / depth + b
_INVERSE_DEPTH = 0
_MAX_LEVEL = 65535
_FLOW_UNITS_PER_PX = 64.0
_FLOW_ZERO = 32768


def encode_rgb(image: UInt8Array, quality: int = _JPEG_QUALITY) -> bytes:
    """JPEG of an (H, W, 3) uint8 RGB image; quality from 1 to 100."""
    return simplejpeg.encode_jpeg(
        np.ascontiguousarray(image), quality=quality, colorspace="RGB", colorsubsampling="420"
    )


def decode_rgb(data: bytes) -> UInt8Array:
    """(H, W, 3) uint8 RGB image decoded from a JPEG."""
    height_px, width_px, *_ = simplejpeg.decode_jpeg_header(data)
    _require_size(width_px, height_px)
    return simplejpeg.decode_jpeg(data, colorspace="RGB")


def encode_labels(image: AnyArray) -> bytes:
    """Lossless PNG of an (H, W) uint8 or uint16 image."""
    return _encode_png(image)


def decode_labels(data: bytes) -> AnyArray:
    """(H, W) uint8 or uint16 image decoded from a PNG."""
    return _decode_png(data, _GRAY, 8, 16)


def encode_depth(depth_m: Float32Array) -> bytes:
    """PNG of inverse depth in 65535 even levels between the farthest and the nearest pixel of the image.

    The format is that of compressed_depth_image_transport, whose decoder reads the quantization parameters from the
    header. There they are fixed for indoor cameras; here they follow the image. With ``near`` and ``far`` as extreme
    depths (``far`` at least twice ``near``), the error at depth d is at most d² (1/near - 1/far) / 131068, plus
    float32's 1e-6 d: with near = 2 m that is 1 cm at 50 m and 4 cm at 100 m.

    Args:
        depth_m: (H, W) float32, meters, > 0; values that are not finite (sky) become level 0.

    Raises:
        ValueError: A depth is not positive.
    """
    finite = np.isfinite(depth_m)
    near_m = float(np.min(depth_m, where=finite, initial=np.inf))
    if near_m <= 0:
        raise ValueError(f"depth must be positive, not {near_m} m")
    far_m = max(float(np.max(depth_m, where=finite, initial=0)), 2 * near_m)
    scale = (_MAX_LEVEL - 1) / (1 / near_m - 1 / far_m) if finite.any() else 1.0
    parameters = np.array([scale, 1 - scale / far_m], np.float32)
    levels = np.rint(parameters[0] / depth_m + parameters[1])
    levels = np.where(finite, np.clip(levels, 1, _MAX_LEVEL), 0).astype(np.uint16)
    return _DEPTH_HEAD.pack(_INVERSE_DEPTH, *parameters.tolist()) + _encode_png(levels)


def decode_depth(data: bytes) -> Float32Array:
    """(H, W) float32 depth in meters; +inf where the image had none (the standard decoder gives NaN there)."""
    _, scale, offset = _DEPTH_HEAD.unpack_from(data)
    levels = _decode_png(data[_DEPTH_HEAD.size :], _GRAY, 16)
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
    u, v = (np.rint(channel * _FLOW_UNITS_PER_PX + _FLOW_ZERO) for channel in cv2.split(flow_px))
    valid = (u >= 0) & (u <= _MAX_LEVEL) & (v >= 0) & (v <= _MAX_LEVEL)
    blue_green_red = [valid, np.where(valid, v, 0), np.where(valid, u, 0)]
    return _encode_png(cv2.merge([channel.astype(np.uint16) for channel in blue_green_red]))


def decode_flow(data: bytes) -> Float32Array:
    """(H, W, 2) float32 flow in pixels, NaN where invalid."""
    valid, v, u = cv2.split(_decode_png(data, _COLOR, 16))
    flow_px: Float32Array = cv2.merge([u, v]).astype(np.float32)
    flow_px -= np.float32(_FLOW_ZERO)
    flow_px *= np.float32(1 / _FLOW_UNITS_PER_PX)
    flow_px[valid == 0] = np.nan
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
    "32FC1": _Codec("32FC1; compressedDepth png", encode_depth, decode_depth),
    "32FC2": _Codec("rgb16; png compressed bgr16", encode_flow, decode_flow),
}
_DECODERS = {codec.format: codec.decode for codec in _CODECS.values()}


def compressed_format(encoding: str) -> str:
    """Value of ``CompressedImage.format`` for images of a ROS encoding."""
    return _CODECS[encoding].format


def encode_image(encoding: str, image: AnyArray, jpeg_quality: int = _JPEG_QUALITY) -> bytes:
    """Compress an image of a ROS encoding to the value of ``CompressedImage.data``."""
    if encoding == "rgb8":
        return encode_rgb(image, jpeg_quality)
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
    except (ValueError, cv2.error, struct.error) as error:
        raise BagError(f"compressed image of format {image_format!r} cannot be decoded: {error}") from None


def _encode_png(image: AnyArray) -> bytes:
    done, data = cv2.imencode(".png", image, _PNG)
    if not done:
        raise ValueError(f"no PNG of an image of shape {image.shape} and type {image.dtype}")
    return data.tobytes()


def _decode_png(data: bytes, color: int, *bits: int) -> AnyArray:
    """Decode a PNG that has this kind of color, and one of these numbers of bits a channel; no other is unpacked."""
    if data[: len(_PNG_START)] != _PNG_START:
        raise ValueError("not a PNG")
    width_px, height_px, *kind = _PNG_HEAD.unpack_from(data, len(_PNG_START))
    _require_size(width_px, height_px)
    if kind not in [[each, color] for each in bits]:
        raise ValueError(f"its pixels have {kind[0]} bits and color type {kind[1]}")
    if width_px * height_px * _CHANNELS[color] * kind[0] // 8 > _MAX_DEFLATE_RATIO * len(data):
        raise ValueError(f"{len(data)} bytes cannot hold {width_px} x {height_px} pixels")
    _require_chunks(data)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise ValueError("not a PNG")
    return image


def _require_chunks(data: bytes) -> None:
    """Raise ValueError if a chunk of a PNG ends after its data; OpenCV allocates first what a chunk says."""
    position = len(_PNG_MAGIC)
    while position < len(data):
        (length,) = _PNG_LENGTH.unpack_from(data, position)
        position += length + _PNG_CHUNK_BYTES
    if position != len(data):
        raise ValueError("it is cut off, or a chunk has a wrong length")


def _require_size(width_px: int, height_px: int) -> None:
    if max(width_px, height_px) > MAX_IMAGE_SIDE_PX:
        raise LimitError(f"it has {width_px} x {height_px} pixels; at most {MAX_IMAGE_SIDE_PX} a side are decoded")
