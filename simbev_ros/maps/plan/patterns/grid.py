"""The grid pattern: streets along irregular lines, inside a ring road without dead ends."""

from itertools import pairwise
from typing import Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from simbev_ros.config.base import Model
from simbev_ros.config.draw import Drawn, sample
from simbev_ros.errors import InputError
from simbev_ros.maps.plan.curves import rounded
from simbev_ros.maps.plan.draft import Draft, DraftRoad, RoadClass
from simbev_ros.maps.plan.patterns.road import Place
from simbev_ros.maps.plan.road_class import NamedRoadClass, road_classes
from simbev_ros.types import Float64Array


class Grid(Model):
    """Streets run along the grid's lines; line 0 and the last one are the ring road."""

    pattern: Literal["grid"]
    name: str = "grid"
    center_m: Place = (0.0, 0.0)
    turned_deg: float = Field(0.0, ge=-90, le=90, description="counter-clockwise")
    columns: int = Field(ge=2, le=30, description="blocks from west to east")
    rows: int = Field(ge=2, le=30, description="blocks from south to north")
    block_m: Drawn = Field(description="distance between neighbouring lines, one draw each")
    street: NamedRoadClass = Field(default_factory=lambda: road_classes()["street"])
    wide: NamedRoadClass = Field(default_factory=lambda: road_classes()["wide_street"])
    ring: NamedRoadClass = Field(default_factory=lambda: road_classes()["street"])
    wide_north_south: tuple[int, ...] = Field((), description="inner lines that are wide, 0 westmost")
    wide_east_west: tuple[int, ...] = Field((), description="inner lines that are wide, 0 southmost")
    merged_blocks: int = Field(0, ge=0, description="how many narrow inner streets are left out at random")
    junction_shift_m: float = Field(0.0, ge=0, le=30, description="largest random shift of an inner junction")
    ring_corner_radius_m: float = Field(25.0, ge=12, le=60)

    @model_validator(mode="after")
    def _wide_lines_are_inner(self) -> Self:
        for name, last in (("wide_north_south", self.columns), ("wide_east_west", self.rows)):
            wrong = [line for line in getattr(self, name) if not 0 < line < last]
            if wrong:
                raise ValueError(f"{name}: must lie between 1 and {last - 1}, not {wrong[0]}")
        return self


class _Node(NamedTuple):
    """A place where two lines of the grid cross."""

    column: int
    row: int


def draw(pattern: Grid, draft: Draft, rng: np.random.Generator) -> None:
    """Append the ring and the streets inside it.

    Raises:
        InputError: The recipe gives blocks that are too small for its ring road.
    """
    places = _draw_places(pattern, rng)
    corners = [(0, 0), (pattern.columns, 0), (pattern.columns, pattern.rows), (0, pattern.rows)]
    ring_m = rounded(np.array([places[_Node(*corner)] for corner in corners]), pattern.ring_corner_radius_m, True)
    draft.roads.append(DraftRoad(f"{pattern.name}.ring", pattern.ring, ring_m))
    left_out = _draw_left_out(pattern, rng)
    for column in range(1, pattern.columns):
        nodes = [_Node(column, row) for row in range(pattern.rows + 1)]
        kind = pattern.wide if column in pattern.wide_north_south else pattern.street
        _append_line(draft, f"{pattern.name}.ns{column}", kind, nodes, places, left_out)
    for row in range(1, pattern.rows):
        nodes = [_Node(column, row) for column in range(pattern.columns + 1)]
        kind = pattern.wide if row in pattern.wide_east_west else pattern.street
        _append_line(draft, f"{pattern.name}.ew{row}", kind, nodes, places, left_out)


def _draw_places(pattern: Grid, rng: np.random.Generator) -> dict[_Node, Float64Array]:
    """Places of all grid nodes in the map frame."""
    x_m, y_m = (_draw_lines(pattern, count, rng) for count in (pattern.columns, pattern.rows))
    cosine, sine = np.cos(np.radians(pattern.turned_deg)), np.sin(np.radians(pattern.turned_deg))
    map_from_grid = np.array([[cosine, -sine], [sine, cosine]])
    places = {}
    for column in range(pattern.columns + 1):
        for row in range(pattern.rows + 1):
            shift_m = rng.uniform(-1.0, 1.0, 2) * pattern.junction_shift_m
            # The ring and the wide streets stay straight: only junctions move, along the wide street that they lie on.
            if column in (0, pattern.columns, *pattern.wide_north_south):
                shift_m[0] = 0.0
            if row in (0, pattern.rows, *pattern.wide_east_west):
                shift_m[1] = 0.0
            place_m = np.array([x_m[column], y_m[row]]) + shift_m
            places[_Node(column, row)] = np.round(map_from_grid @ place_m + pattern.center_m, 2)
    return places


def _draw_lines(pattern: Grid, blocks: int, rng: np.random.Generator) -> Float64Array:
    """Coordinates of the grid's lines along one axis, centred on 0."""
    blocks_m = [sample(pattern.block_m, rng) for _ in range(blocks)]
    smallest_m = 2.0 * (pattern.ring_corner_radius_m + pattern.junction_shift_m)
    if min(blocks_m) < smallest_m:
        raise InputError(
            f"{pattern.name}: block_m: {min(blocks_m):.1f} m is too small for ring_corner_radius_m and "
            f"junction_shift_m; with these a block needs {smallest_m:.1f} m"
        )
    lines_m: Float64Array = np.cumsum([0.0, *blocks_m])
    lines_m -= lines_m[-1] / 2.0
    return lines_m


def _draw_left_out(pattern: Grid, rng: np.random.Generator) -> set[tuple[_Node, _Node]]:
    """Pairs of neighbouring inner nodes without their narrow street; a junction loses one arm at most."""
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
    left_out: set[tuple[_Node, _Node]] = set()
    thinned: set[_Node] = set()
    for index in rng.permutation(len(candidates)):
        a, b = candidates[index]
        if len(left_out) < pattern.merged_blocks and a not in thinned and b not in thinned:
            left_out.add((a, b))
            thinned.update((a, b))
    return left_out


def _append_line(
    draft: Draft,
    name: str,
    kind: RoadClass,
    nodes: list[_Node],
    places: dict[_Node, Float64Array],
    left_out: set[tuple[_Node, _Node]],
) -> None:
    """Append the streets along one line of the grid, one for each stretch without gap."""
    gaps = [index for index, pair in enumerate(pairwise(nodes), start=1) if pair in left_out]
    bounds = [0, *gaps, len(nodes)]
    for number, (first, last) in enumerate(pairwise(bounds)):
        if last - first > 1:
            line_m = np.array([places[node] for node in nodes[first:last]])
            draft.roads.append(DraftRoad(f"{name}.{number}", kind, line_m))
