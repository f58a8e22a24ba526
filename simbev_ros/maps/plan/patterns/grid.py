"""The grid pattern of a town recipe: streets along irregular lines, inside a ring road without dead ends."""

from itertools import pairwise
from typing import Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from simbev_ros.config.base import Model
from simbev_ros.config.draw import Drawn, sample
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.plan.curves import round_corners
from simbev_ros.maps.plan.draft import Draft, DraftRoad, RoadClass
from simbev_ros.maps.plan.patterns.road import PointXY
from simbev_ros.maps.plan.road_class import NamedRoadClass, road_classes


class Grid(Model):
    """Streets along the lines of a grid; line 0 and the last line of each axis form the ring road."""

    pattern: Literal["grid"]
    name: str = "grid"
    center_m: PointXY = (0.0, 0.0)
    turned_deg: float = Field(0.0, ge=-90, le=90, description="counter-clockwise")
    columns: int = Field(ge=2, le=30, description="blocks from west to east")
    rows: int = Field(ge=2, le=30, description="blocks from south to north")
    block_m: Drawn = Field(description="distance between neighboring lines, one draw each")
    street: NamedRoadClass = Field(default_factory=lambda: road_classes()["street"])
    wide: NamedRoadClass = Field(default_factory=lambda: road_classes()["wide_street"])
    ring: NamedRoadClass = Field(default_factory=lambda: road_classes()["street"])
    wide_north_south: tuple[int, ...] = Field((), description="inner lines that are wide, 0 is the westernmost")
    wide_east_west: tuple[int, ...] = Field((), description="inner lines that are wide, 0 is the southernmost")
    merged_blocks: int = Field(0, ge=0, description="number of narrow inner streets that are left out at random")
    junction_shift_m: float = Field(0.0, ge=0, le=30, description="maximum random shift of an inner junction")
    ring_corner_radius_m: float = Field(25.0, ge=12, le=60)

    @model_validator(mode="after")
    def _wide_lines_are_inner(self) -> Self:
        for name, last in (("wide_north_south", self.columns), ("wide_east_west", self.rows)):
            wrong = [line for line in getattr(self, name) if not 0 < line < last]
            if wrong:
                raise ValueError(f"{name}: must lie between 1 and {last - 1}, not {wrong[0]}")
        return self


class _Node(NamedTuple):
    """An intersection of two lines of the grid."""

    column: int
    row: int


def draw_grid(pattern: Grid, draft: Draft, rng: np.random.Generator) -> None:
    """Append the ring and the streets inside it.

    Raises:
        InputError: The recipe's blocks are too small for its ring road.
    """
    positions = _draw_positions(pattern, rng)
    corners = [(0, 0), (pattern.columns, 0), (pattern.columns, pattern.rows), (0, pattern.rows)]
    ring_m = round_corners(
        np.array([positions[_Node(*corner)] for corner in corners]), pattern.ring_corner_radius_m, True
    )
    draft.roads.append(DraftRoad(f"{pattern.name}.ring", pattern.ring, ring_m))
    omitted = _draw_omitted_streets(pattern, rng)
    for column in range(1, pattern.columns):
        nodes = [_Node(column, row) for row in range(pattern.rows + 1)]
        kind = pattern.wide if column in pattern.wide_north_south else pattern.street
        _append_line(draft, f"{pattern.name}.ns{column}", kind, nodes, positions, omitted)
    for row in range(1, pattern.rows):
        nodes = [_Node(column, row) for column in range(pattern.columns + 1)]
        kind = pattern.wide if row in pattern.wide_east_west else pattern.street
        _append_line(draft, f"{pattern.name}.ew{row}", kind, nodes, positions, omitted)


def _draw_positions(pattern: Grid, rng: np.random.Generator) -> dict[_Node, Float64Array]:
    """Draw the positions of all grid nodes, map frame."""
    x_m, y_m = (_draw_lines(pattern, count, rng) for count in (pattern.columns, pattern.rows))
    cosine, sine = np.cos(np.radians(pattern.turned_deg)), np.sin(np.radians(pattern.turned_deg))
    map_from_grid = np.array([[cosine, -sine], [sine, cosine]])
    positions = {}
    for column in range(pattern.columns + 1):
        for row in range(pattern.rows + 1):
            shift_m = rng.uniform(-1.0, 1.0, 2) * pattern.junction_shift_m
            # The ring and the wide streets stay straight: junctions on them move only along the street.
            if column in (0, pattern.columns, *pattern.wide_north_south):
                shift_m[0] = 0.0
            if row in (0, pattern.rows, *pattern.wide_east_west):
                shift_m[1] = 0.0
            position_m = np.array([x_m[column], y_m[row]]) + shift_m
            positions[_Node(column, row)] = np.round(map_from_grid @ position_m + pattern.center_m, 2)
    return positions


def _draw_lines(pattern: Grid, blocks: int, rng: np.random.Generator) -> Float64Array:
    """Draw the coordinates of the grid's lines along one axis, centered on 0."""
    blocks_m = [sample(pattern.block_m, rng) for _ in range(blocks)]
    min_block_m = 2.0 * (pattern.ring_corner_radius_m + pattern.junction_shift_m)
    if min(blocks_m) < min_block_m:
        raise InputError(
            f"{pattern.name}: block_m: {min(blocks_m):.1f} m is too small for ring_corner_radius_m and "
            f"junction_shift_m; with these a block needs {min_block_m:.1f} m"
        )
    lines_m: Float64Array = np.cumsum([0.0, *blocks_m])
    lines_m -= lines_m[-1] / 2.0
    return lines_m


def _draw_omitted_streets(pattern: Grid, rng: np.random.Generator) -> set[tuple[_Node, _Node]]:
    """Draw pairs of adjacent inner nodes without a narrow street between them; a junction loses at most one arm."""
    inner = [_Node(c, r) for c in range(1, pattern.columns) for r in range(1, pattern.rows)]
    candidates = [
        (a, b)
        for a in inner
        for b, wide in (
            (_Node(a.column + 1, a.row), a.row in pattern.wide_east_west),
            (_Node(a.column, a.row + 1), a.column in pattern.wide_north_south),
        )
        if b in inner and not wide
    ]
    omitted: set[tuple[_Node, _Node]] = set()
    thinned: set[_Node] = set()
    for index in rng.permutation(len(candidates)):
        a, b = candidates[index]
        if len(omitted) < pattern.merged_blocks and a not in thinned and b not in thinned:
            omitted.add((a, b))
            thinned.update((a, b))
    return omitted


def _append_line(
    draft: Draft,
    name: str,
    kind: RoadClass,
    nodes: list[_Node],
    positions: dict[_Node, Float64Array],
    omitted: set[tuple[_Node, _Node]],
) -> None:
    """Append the streets along one line of the grid, one for each stretch without gap."""
    gaps = [index for index, pair in enumerate(pairwise(nodes), start=1) if pair in omitted]
    bounds = [0, *gaps, len(nodes)]
    for number, (first, last) in enumerate(pairwise(bounds)):
        if last - first > 1:
            line_m = np.array([positions[node] for node in nodes[first:last]])
            draft.roads.append(DraftRoad(f"{name}.{number}", kind, line_m))
