"""The tables of tables.yaml: meanings of the tags in Lanelet2 files."""

import re
from typing import Any, Final

from simbev_ros.foundation.tables import load_table
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Paint, SignKind

_TABLES: Final[dict[str, Any]] = load_table("simbev_ros.maps.lanelet2", "tables.yaml")

LANE_KINDS: Final = {name: LaneKind(kind) for name, kind in _TABLES["lane_kinds"].items()}
"""Subtype of a lanelet → its use."""

PARTICIPANTS: Final = {name: LaneKind(kind) for name, kind in _TABLES["participants"].items()}
"""Participant → use of a lanelet that admits it, in order of precedence."""

RESERVED: Final[dict[str, str]] = _TABLES["reserved"]
"""Use or subtype of a lanelet → the only SUMO vehicle classes that may use it."""

DEFAULT_SPEEDS_KMH: Final[dict[str, dict[str, float]]] = _TABLES["speeds"]
"""Subtype, or "default" → location → speed limit of a lanelet that states none."""

SPEED_UNITS_MPS: Final[dict[str, float]] = _TABLES["speed_units"]
"""Speed unit → meters per second; "" is the unit of numbers without one."""

PAINT_WIDTHS_M: Final[dict[str, float]] = _TABLES["paint_widths"]
"""Type of a line that is paint → width of one of its lines."""

PAINTS: Final = {name: Paint(paint) for name, paint in _TABLES["paints"].items()}
"""Subtype of a painted line → paint, from left to right."""

LANE_CHANGES: Final = {Paint(paint): tuple(sides) for paint, sides in _TABLES["lane_changes"].items()}
"""Paint → whether one may change lanes across it to the left and to the right; across other paint, one may not."""

SIGN_KINDS: Final = {code: SignKind(kind) for kind, codes in _TABLES["signs"].items() for code in codes}
"""Subtype of a traffic sign → its meaning; speed limits match ``SPEED_SIGN``."""

SPEED_SIGN: Final = re.compile(_TABLES["speed_sign"])
"""Pattern of the subtypes of speed limit signs; group 1 is the value, in mph for signs of the United States."""

WITHOUT_EFFECT: Final = frozenset(_TABLES["without_effect"])
"""Subtypes of regulatory elements that change nothing in this simulation."""
