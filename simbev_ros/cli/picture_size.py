"""Sizes of pictures as they are written on the command line: ``1600x900``."""

import re

from simbev_ros.foundation.errors import InputError

MAX_PX = 8192


def picture_size_px(text: str, min_px: int) -> tuple[int, int]:
    """Parse a width and a height in pixels.

    Raises:
        InputError: It is not of that form, too small or too large.
    """
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text, re.ASCII)
    if match is None or not all(min_px <= int(side) <= MAX_PX for side in match.groups()):
        raise InputError(
            f"--size {text}: must be WIDTHxHEIGHT in pixels, each from {min_px} to {MAX_PX}, for example 1600x900"
        )
    return int(match[1]), int(match[2])
