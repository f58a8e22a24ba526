"""The layout of the roads: ground geometry of lanes, with their borders, heights and paint.

There are two views of the same roads: ``network.Lane`` is a lane of the traffic simulation (SUMO), ``Strip`` is its
geometry on the ground (from OpenDRIVE for OpenDRIVE maps, otherwise from SUMO's lanes). Surfaces, markings, heights,
levels and the HD map are derived from strips. Heights are those of the carriageway's plane, also under raised
sidewalks; ``raised_lanes`` adds the heights of lanes that the map raises.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from typing import TypeVar

import numpy as np
import shapely

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.columns import SPARSE
from simbev_ros.maps.roads.lane_kind import LaneKind

_Item = TypeVar("_Item")


class Paint(StrEnum):
    """Paint along a lane's border, seen from the lane's inside outward (OpenDRIVE 1.4, e_roadMarkType)."""

    NONE = "none"
    SOLID = "solid"
    BROKEN = "broken"
    SOLID_SOLID = "solid solid"
    SOLID_BROKEN = "solid broken"
    BROKEN_SOLID = "broken solid"
    BROKEN_BROKEN = "broken broken"
    BOTTS_DOTS = "botts dots"
    CURB = "curb"


class PaintColor(StrEnum):
    """Color of a line; OpenDRIVE's standard is white."""

    WHITE = "white"
    YELLOW = "yellow"
    BLUE = "blue"
    GREEN = "green"
    RED = "red"
    ORANGE = "orange"


@dataclass(frozen=True, slots=True)
class Line:
    """Paint along one border of a strip; ``width_m`` is the width of one of its lines."""

    paint: Paint = Paint.NONE
    color: PaintColor = PaintColor.WHITE
    width_m: float = 0.12


@dataclass(frozen=True, slots=True)
class Strip:
    """Ground geometry of a lane, or of a stretch of one, with a constant level.

    Attributes:
        id: Unique id.
        lane: Id of the lane that it is a stretch of: ``road/section/lane`` for OpenDRIVE, else SUMO's lane id.
        kind: Its use.
        left_m: (N, 3) float64 left border, map frame, in driving direction (if only walked on: in the road's
            direction).
        right_m: (N, 3) right border; point k lies across from point k of ``left_m``.
        s_start_m: Distance from the lane's start to the strip's start.
        left_line: Paint on the left border.
        right_line: Paint on the right border.
        road: Id of the road (OpenDRIVE) or edge (SUMO).
        section: Index of the lane section, 0 if the source has none.
        index: OpenDRIVE's lane id within its section (negative on the right of the reference line); SUMO: -(lane index
            from the left) - 1.
        junction: Id of the junction that contains it, else "".
        continues: A road only continues in that junction, without meeting another.
        speed_mps: Speed limit.
        structure: The source declares that a bridge carries it.
        level: 0 on the ground; k > 0 on a structure, above k layers of roads, water or air; higher still in tunnels
            (``levels.assign_levels``).
        left: ``lane`` of the adjacent strip on the left, in driving direction, or "".
        right: ``lane`` of the adjacent strip on the right, or "".
        following: ``lane`` ids of its successors.
        outline_m: (M, 2) float64 outline where borders do not describe the area (walking areas), else None.
        tunnel: It runs through a tunnel.
        raised_m: (N, 2) heights of the left and the right border above the carriageway's plane; None: the height of its
            kind, ``lane_kind.raised_of``.
    """

    id: str
    lane: str
    kind: LaneKind
    left_m: Float64Array
    right_m: Float64Array
    s_start_m: float = 0.0
    left_line: Line = field(default_factory=Line)
    right_line: Line = field(default_factory=Line)
    road: str = ""
    section: int = 0
    index: int = -1
    junction: str = ""
    continues: bool = False
    speed_mps: float = 0.0
    structure: bool = False
    level: int = 0
    left: str = ""
    right: str = ""
    following: tuple[str, ...] = ()
    outline_m: Float64Array | None = None
    tunnel: bool = field(default=False, metadata=SPARSE)
    raised_m: Float64Array | None = field(default=None, metadata=SPARSE)

    @property
    def center_m(self) -> Float64Array:
        """(N, 3) center line."""
        return (self.left_m + self.right_m) / 2.0


@dataclass(frozen=True, slots=True)
class Crosswalk:
    """A marked crosswalk.

    Attributes:
        outline_m: (N, 3) corners, map frame.
        axis: (2,) unit vector of the walking direction.
        level: Level, as for strips.
    """

    outline_m: Float64Array
    axis: Float64Array
    level: int = 0


class SignKind(StrEnum):
    """Meaning of a traffic sign."""

    STOP = "stop"
    YIELD = "yield"
    SPEED_LIMIT = "speed_limit"


@dataclass(frozen=True, slots=True)
class Sign:
    """A traffic sign on a post.

    Attributes:
        kind: Its meaning.
        foot_m: (3,) foot of its post, map frame, on the carriageway's plane.
        yaw_rad: Direction that its face points in, towards the traffic that it is for.
        lanes: Ids of the ``network.Lane``s that it applies to.
        speed_mps: Value of speed limits, else 0.
    """

    kind: SignKind
    foot_m: Float64Array
    yaw_rad: float
    lanes: tuple[str, ...]
    speed_mps: float = 0.0


@dataclass(frozen=True, slots=True)
class SignalPlace:
    """Mount of a traffic light as the map defines it; the signal state is part of SUMO's programs.

    Attributes:
        foot_m: (3,) foot of the pole, map frame, on the carriageway's plane.
        head_m: (3,) center of the head.
        yaw_rad: Direction in which the lamps shine, towards the traffic that they are for.
        lanes: Ids of the ``network.Lane``s that they apply to.
        opendrive_id: Id of the map's signal.
    """

    foot_m: Float64Array
    head_m: Float64Array
    yaw_rad: float
    lanes: tuple[str, ...]
    opendrive_id: str = ""


@dataclass(frozen=True, slots=True)
class StopLine:
    """A painted bar at which traffic halts.

    Attributes:
        ends_m: (2, 3) its ends from right to left, map frame.
        level: Level, as for strips.
        yields: A row of triangles, at which traffic only gives way.
    """

    ends_m: Float64Array
    level: int = 0
    yields: bool = False


@dataclass(frozen=True, eq=False)
class Layout:
    """Ground geometry of all roads of a map.

    Attributes:
        strips: Lanes on the ground.
        crosswalks: Marked crosswalks.
        stop_lines: Stop lines and yield lines.
        signs: Traffic signs.
        signal_places: Mounts of traffic lights defined by the map; if empty, they are placed by rule.
        corner_radius_m: Radius of junction corners, if lanes do not describe them; 0: lanes describe the whole area.
    """

    strips: tuple[Strip, ...]
    crosswalks: tuple[Crosswalk, ...]
    stop_lines: tuple[StopLine, ...]
    signs: tuple[Sign, ...]
    signal_places: tuple[SignalPlace, ...] = ()
    corner_radius_m: float = 0.0

    def strips_of(self, *kinds: LaneKind, level: int | None = None) -> tuple[Strip, ...]:
        """Strips of these kinds, on one level or on all, in order."""
        return tuple(strip for strip in self.strips if strip.kind in kinds and level in (None, strip.level))

    @cached_property
    def levels(self) -> range:
        """All levels, 0 to the highest."""
        return range(1 + max((strip.level for strip in self.strips), default=0))

    @cached_property
    def tunnel_levels(self) -> range:
        """The levels of tunnels, which follow those of the ground and of structures; empty if there are none."""
        return range(
            min((strip.level for strip in self.strips if strip.tunnel), default=len(self.levels)), len(self.levels)
        )

    def near(self, area: shapely.Polygon, margin_m: float) -> "Layout":
        """The layout restricted to strips, crosswalks and stop lines with bounds near an area's bounds.

        Keeps all signs and signals. Results computed from it are correct inside the area if they depend on nothing
        beyond the margin.
        """
        bounds_m = np.array(area.bounds) + margin_m * np.array([-1.0, -1.0, 1.0, 1.0])
        strips_m, crosswalks_m, stop_lines_m = self._bounds_m
        return replace(
            self,
            strips=_touching_items(self.strips, strips_m, bounds_m),
            crosswalks=_touching_items(self.crosswalks, crosswalks_m, bounds_m),
            stop_lines=_touching_items(self.stop_lines, stop_lines_m, bounds_m),
        )

    @cached_property
    def _bounds_m(self) -> tuple[Float64Array, Float64Array, Float64Array]:
        """(N, 4) x0, y0, x1, y1 of strips, crosswalks and stop lines."""
        strips = [
            np.concatenate([strip.left_m[:, :2], strip.right_m[:, :2]]) if strip.outline_m is None else strip.outline_m
            for strip in self.strips
        ]
        crosswalks = [crosswalk.outline_m[:, :2] for crosswalk in self.crosswalks]
        return _bounds(strips), _bounds(crosswalks), _bounds([line.ends_m[:, :2] for line in self.stop_lines])


def _bounds(shapes_m: Sequence[Float64Array]) -> Float64Array:
    """(N, 4) x0, y0, x1, y1 of (M, 2) shapes."""
    if not shapes_m:
        return np.empty((0, 4))
    points_m = np.concatenate(shapes_m)
    first = np.cumsum([0, *map(len, shapes_m)])[:-1]
    return np.column_stack([np.minimum.reduceat(points_m, first), np.maximum.reduceat(points_m, first)])


def _touching_items(items: Sequence[_Item], bounds_m: Float64Array, area_m: Float64Array) -> tuple[_Item, ...]:
    """The items of N whose (N, 4) bounds touch (4,) bounds."""
    (x0, y0, x1, y1), (west_m, south_m, east_m, north_m) = bounds_m.T, area_m.tolist()
    is_touching = (x0 <= east_m) & (y0 <= north_m) & (x1 >= west_m) & (y1 >= south_m)
    return tuple(items[row] for row in np.flatnonzero(is_touching).tolist())
