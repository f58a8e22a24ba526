"""Draws text, rounded pictures and labels on (H, W, 3) uint8 RGB images, in place. All coordinates are in pixels."""

from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from simbev_ros.foundation.types import Float32Array, UInt8Array

Color = tuple[int, int, int]
"""Red, green and blue, 0..255."""

BACKGROUND: Color = (11, 13, 17)
SURFACE: Color = (22, 25, 31)
LINE: Color = (52, 58, 68)
TEXT: Color = (236, 239, 244)
DIM: Color = (146, 154, 168)
ACCENT: Color = (45, 212, 191)


class Box(NamedTuple):
    """A rectangle on an image, in pixels; x to the right, y downward."""

    left: int
    top: int
    width: int
    height: int


REGULAR, BOLD = 0.0, 0.35
"""Weights of text: width of the outline drawn around the glyphs, in pixels at size 15."""


@lru_cache(maxsize=16)
def _font(size: int) -> ImageFont.FreeTypeFont:
    font = ImageFont.load_default(size)
    assert isinstance(font, ImageFont.FreeTypeFont), "Pillow comes with FreeType in its wheels and in Debian"
    return font


def draw_text(
    image: UInt8Array,
    text: str,
    x: float,
    baseline: float,
    *,
    size: float,
    color: Color = TEXT,
    weight: float = REGULAR,
    right: bool = False,
) -> float:
    """Draw one line of text in place.

    Args:
        image: (H, W, 3) RGB, changed in place.
        text: The text.
        x: Left end of the text, or its right end with ``right``.
        baseline: y of the baseline.
        size: Font size.
        color: Color of the text.
        weight: ``REGULAR`` or ``BOLD``.
        right: Whether ``x`` is the right end.

    Returns:
        The x of the other end of the text.
    """
    width = text_width(text, size, weight)
    left = x - width if right else x
    top, bottom = max(round(baseline - 1.5 * size), 0), round(baseline + 0.6 * size)
    start, end = max(round(left) - 2, 0), round(left + width) + 3
    part = image[top:bottom, start:end]
    mask = Image.new("L", (part.shape[1], part.shape[0]))
    position = (left - start, baseline - top)
    ImageDraw.Draw(mask).text(position, text, 255, _font(round(size)), "ls", stroke_width=weight * size / 15)
    opacity = np.asarray(mask, np.float32)[..., None] / 255
    part[...] = np.rint(part + (np.asarray(color, np.float32) - part) * opacity)
    return left if right else left + width


def text_width(text: str, size: float, weight: float = REGULAR) -> float:
    """Width of a line of text at a font size and weight, in pixels."""
    return _font(round(size)).getlength(text) + 2 * weight * size / 15


def draw_picture(image: UInt8Array, picture: UInt8Array, box: Box, radius: float) -> None:
    """Draw an RGB picture into a box of an image, in place: scaled to fill the box, with rounded corners."""
    height, width = picture.shape[:2]
    if (width, height) != (box.width, box.height):
        shrinks = width > box.width
        interpolation = cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC
        picture = np.asarray(cv2.resize(picture, (box.width, box.height), interpolation=interpolation), np.uint8)
    _blend(image, picture, box, _rounded(box.width, box.height, round(radius, 1)))


def draw_label(image: UInt8Array, box: Box, title: str, note: str, scale: float) -> None:
    """Write a bold title and a dimmer note on a dark plate in the upper left corner of a box, in place."""
    size, inset, padding = 15 * scale, 9 * scale, 8 * scale
    height = round(25 * scale)
    width = text_width(title, size, BOLD) + (text_width(note, size) + padding if note else 0) + 2 * padding
    plate = Box(round(box.left + inset), round(box.top + inset), round(width), height)
    mask = _rounded(plate.width, plate.height, round(5 * scale, 1)) * np.float32(0.78)
    _blend(image, np.full((plate.height, plate.width, 3), BACKGROUND, np.uint8), plate, mask)
    baseline = plate.top + 0.71 * height
    end = draw_text(image, title, plate.left + padding, baseline, size=size, weight=BOLD)
    if note:
        draw_text(image, note, end + padding, baseline, size=size, color=DIM)


def _blend(image: UInt8Array, picture: UInt8Array, box: Box, mask: Float32Array) -> None:
    """Blend a picture of a box's size into the image by an opacity mask in 0..1, in place."""
    part = image[box.top : box.top + box.height, box.left : box.left + box.width]
    mixed = cv2.blendLinear(picture, np.ascontiguousarray(part), mask, 1 - mask)
    part[...] = mixed


@lru_cache(maxsize=64)
def _rounded(width: int, height: int, radius: float) -> Float32Array:
    """(height, width) coverage in 0..1 of a rectangle with rounded corners."""
    x = np.abs(np.arange(width) + 0.5 - width / 2) - (width / 2 - radius)
    y = np.abs(np.arange(height) + 0.5 - height / 2) - (height / 2 - radius)
    distance = np.hypot(np.maximum(x, 0)[None, :], np.maximum(y, 0)[:, None]) - radius
    return np.asarray(np.clip(0.5 - distance, 0, 1), np.float32)
