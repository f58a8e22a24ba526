"""Display colors of labels: semantic tags and traffic lights by palette.yaml, classes by foundation/classes.yaml."""

from functools import lru_cache
from typing import Any

import numpy as np

from simbev_ros.foundation.semantics import BEV_CLASSES, CLASSES, Tag
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import UInt8Array, UInt16Array


def semantic_color(tags: UInt8Array) -> UInt8Array:
    """(…, 3) sRGB colors, 0..255, of (…) semantic tags; the colors are CARLA's."""
    return _semantic_table().take(tags, axis=0)  # several times faster than indexing


def bev_color(labels: UInt16Array) -> UInt8Array:
    """(…, 3) sRGB colors, 0..255, of (…) bird's-eye-view labels; the topmost class of a cell determines its color."""
    return _bev_table().take(labels, axis=0)


def class_color(name: str) -> tuple[int, int, int]:
    """Color (sRGB, 0..255) of a class of boxes or of the bird's-eye view."""
    return rgb_channels(CLASSES[name]["color"])


def chart_color(name: str) -> tuple[int, int, int]:
    """Color (sRGB, 0..255) of a class in charts: like that of the bird's-eye view, but readable on white and black."""
    return rgb_channels(CLASSES[name]["chart"])


def signal_color(state: str) -> tuple[int, int, int]:
    """Color (sRGB, 0..255) of a traffic-light state."""
    return rgb_channels(_palette()["signal"][state])


@lru_cache(maxsize=1)
def _semantic_table() -> UInt8Array:
    """(256, 3) color per tag; black for unused tag numbers."""
    table = np.zeros((256, 3), np.uint8)
    for tag in Tag:
        table[tag] = _rgb(_palette()["semantic"][tag.name])
    return table


@lru_cache(maxsize=1)
def _bev_table() -> UInt8Array:
    """(2^classes, 3) color per combination of classes."""
    labels = np.arange(1 << len(BEV_CLASSES))
    table = np.tile(_rgb(_palette()["bev_background"]), (len(labels), 1))
    for row in (each for each in CLASSES.values() if "bit" in each):
        table[labels >> row["bit"] & 1 == 1] = _rgb(row["color"])
    return table


def rgb_channels(code: int) -> tuple[int, int, int]:
    """Red, green and blue, 0..255, of a color 0xRRGGBB."""
    red, green, blue = _rgb(code).tolist()
    return red, green, blue


def _rgb(code: int) -> UInt8Array:
    return np.array([code >> 16, code >> 8 & 255, code & 255], np.uint8)


@lru_cache(maxsize=1)
def _palette() -> dict[str, Any]:
    return load_table("simbev_ros.schema", "palette.yaml")
