"""Color palettes of the static world, read from palettes.yaml."""

from functools import lru_cache
from typing import Any

import numpy as np

from simbev_ros.foundation.tables import load_table

Color = tuple[int, int, int]


def pick_color(rng: np.random.Generator, name: str, variation: float = 0.05) -> Color:
    """Draw a color of a palette, and make it lighter or darker at random.

    Args:
        rng: Random generator to draw from.
        name: Key of palettes.yaml; dots separate nested keys.
        variation: Maximum relative change of lightness.
    """
    entry: Any = _palettes()
    for key in name.split("."):
        entry = entry[key]
    code = int(entry[int(rng.integers(len(entry)))])
    return shade_color(rgb(code), 1.0 + rng.uniform(-variation, variation))


def rgb(code: int) -> Color:
    """The channels of a color 0xRRGGBB."""
    return code >> 16, code >> 8 & 255, code & 255


def shade_color(color: Color, factor: float) -> Color:
    """Scale a color's brightness: a factor above 1 makes it lighter, below 1 darker."""
    red, green, blue = (min(255, max(0, round(channel * factor))) for channel in color)
    return red, green, blue


@lru_cache(maxsize=1)
def _palettes() -> dict[str, Any]:
    return load_table("simbev_ros.assets", "palettes.yaml")
