"""Parses lengths and directions in the tags of OpenStreetMap, with their usual units."""

import re

import numpy as np

_UNITS_M = {"": 1.0, "m": 1.0, "cm": 0.01, "km": 1000.0, "ft": 0.3048, "feet": 0.3048, "in": 0.0254}
_LENGTH = re.compile(r"~?(\d{1,5}(?:[.,]\d{1,4})?) ?(m|cm|km|ft|feet|in)?(?:eters?|etres?)?")
_FEET_AND_INCHES = re.compile(r"""(\d{1,4}(?:\.\d{1,3})?)(?:'|ft) ?(?:(\d{1,2}(?:\.\d{1,3})?)(?:"|''|in))?""")
_POINTS = ("N", "NNE", "NE", "ENE", "E", "ESE", "SE", "SSE", "S", "SSW", "SW", "WSW", "W", "WNW", "NW", "NNW")


def parse_length_m(text: str) -> float:
    """Parse a length such as ``12``, ``12.5 m``, ``40 ft`` or ``6'3"``, in meters; 0 if it is none."""
    text = text.strip().replace("\u2032", "'").replace("\u2033", '"')
    if (feet := _FEET_AND_INCHES.fullmatch(text)) is not None:
        return float(feet[1]) * _UNITS_M["ft"] + float(feet[2] or 0.0) * _UNITS_M["in"]
    match = _LENGTH.fullmatch(text)
    return 0.0 if match is None else float(match[1].replace(",", ".")) * _UNITS_M[match[2] or ""]


def parse_direction_rad(text: str) -> float:
    """Parse a compass direction such as ``90`` or ``NE`` as a heading in the map frame; NaN if it is none."""
    text = text.strip().upper()
    if text in _POINTS:
        bearing_deg = _POINTS.index(text) * 360.0 / len(_POINTS)
    elif re.fullmatch(r"\d{1,3}(\.\d{1,3})?", text):
        bearing_deg = float(text)
    else:
        return float(np.nan)
    return float(np.radians(90.0 - bearing_deg))
