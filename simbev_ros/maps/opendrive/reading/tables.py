"""The tables of tables.yaml: meanings of the names and codes in OpenDRIVE files."""

import re
from typing import Any, Final

from simbev_ros.foundation.tables import load_table
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Paint, PaintColor

_TABLES: Final[dict[str, Any]] = load_table("simbev_ros.maps.opendrive.reading", "tables.yaml")

LANE_KINDS: Final = {name: LaneKind(kind) for name, kind in _TABLES["lane_kinds"].items()}
"""Lane type → its use; lanes of other types are left out."""

NO_TRAFFIC: Final = frozenset(_TABLES["no_traffic"])
"""Lane types without traffic."""

RESERVED: Final[dict[str, str]] = _TABLES["reserved_lanes"]
"""Lane type → the only SUMO vehicle classes that may use it."""

DEFAULT_SPEEDS_MPS: Final[dict[str, float]] = {name: kmh / 3.6 for name, kmh in _TABLES["default_speeds"].items()}
"""Road type, or "default" → speed limit of a road that states none."""

SPEED_UNITS_MPS: Final[dict[str, float]] = _TABLES["speed_units"]
"""Speed unit → meters per second."""

PAINTS: Final = {name: Paint(paint) for name, paint in _TABLES["road_marks"].items()}
"""Type of a road mark → paint."""

PAINT_COLORS: Final = {name: PaintColor(color) for name, color in _TABLES["road_mark_colors"].items()}
"""Color of a road mark → color of paint."""

PAINT_WIDTHS_M: Final[dict[str, float]] = _TABLES["road_mark_widths"]
"""Weight of a road mark → width of one of its lines."""

SIGNAL_MEANINGS: Final = {code: meaning for meaning, codes in _TABLES["signals"].items() for code in codes}
"""Type of a signal → its meaning."""

NAMED_SPEED_LIMIT: Final = re.compile(_TABLES["named_speed_limit"], re.IGNORECASE)
"""Pattern for names of objects that are speed limits; group 1 is km/h."""

NUMBERS: Final = frozenset(_TABLES["numbers"])
"""Attributes that are numbers, in whatever element they are."""
