"""From a recipe and a seed to a plan of streets: SUMO's plain XML nodes, edges and connections, before netconvert.

The plan is a grid with drawn distances between its lines. Inner junctions are shifted, some narrow streets are left
out, and the corners of the outer ring are rounded, so every street leads on at both ends.
"""

from dataclasses import dataclass
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from simbev_ros.config.draw import sample
from simbev_ros.errors import InputError
from simbev_ros.maps.recipe import StreetRecipe, TownRecipe
from simbev_ros.random import stream
from simbev_ros.types import Float64Array

_ARC_STEPS = 24


class _Node(NamedTuple):
    """A place where two lines of the grid cross."""

    column: int
    row: int

    @property
    def id(self) -> str:
        return f"{chr(ord('A') + self.column)}{self.row}"


@dataclass(frozen=True, slots=True)
class Street:
    """A two-way street between two junctions; ``line_m`` is its (N, 2) centre line from ``start`` to ``end``."""

    start: str
    end: str
    lanes_per_direction: int
    line_m: Float64Array


@dataclass(frozen=True, slots=True)
class StreetPlan:
    """Junctions by id, at (2,) metres in the map frame, and the streets between them."""

    junctions: dict[str, Float64Array]
    streets: tuple[Street, ...]

    def incoming_lanes(self, junction: str) -> int:
        """Number of driving lanes that lead to a junction."""
        return sum(street.lanes_per_direction for street in self.streets if junction in (street.start, street.end))


def draw_plan(recipe: TownRecipe, seed: int) -> StreetPlan:
    """The plan of a town; the same seed gives the same plan.

    Raises:
        InputError: The recipe gives blocks that are too small for its ring road.
    """
    streets = recipe.streets
    rng = stream(seed, f"map.{recipe.name}.streets")
    positions = _draw_positions(streets, rng)
    segments = _draw_segments(streets, rng)
    corners = [(c, r) for c in (0, streets.columns) for r in (0, streets.rows)]
    plan = [
        Street(a.id, b.id, _lanes(streets, a, b), np.array([positions[a], positions[b]])) for a, b in sorted(segments)
    ]
    plan += [_ring_corner(streets, positions, _Node(*corner)) for corner in corners]
    junctions = {node.id: position for node, position in positions.items() if tuple(node) not in corners}
    return StreetPlan(junctions, tuple(plan))


def _draw_positions(streets: StreetRecipe, rng: np.random.Generator) -> dict[_Node, Float64Array]:
    """Positions of all grid nodes; the map's origin is the middle of the town."""
    x_m, y_m = (_draw_lines(streets, count, rng) for count in (streets.columns, streets.rows))
    positions = {}
    for column in range(streets.columns + 1):
        for row in range(streets.rows + 1):
            shift_m = rng.uniform(-1.0, 1.0, 2) * streets.junction_shift_m
            # The ring and the wide streets stay straight: only junctions move, along the wide street that they lie on.
            if column in (0, streets.columns, *streets.wide_north_south):
                shift_m[0] = 0.0
            if row in (0, streets.rows, *streets.wide_east_west):
                shift_m[1] = 0.0
            positions[_Node(column, row)] = np.round([x_m[column] + shift_m[0], y_m[row] + shift_m[1]], 2)
    return positions


def _draw_lines(streets: StreetRecipe, blocks: int, rng: np.random.Generator) -> Float64Array:
    """Coordinates of the grid's lines along one axis, centred on 0."""
    blocks_m = [sample(streets.block_m, rng) for _ in range(blocks)]
    smallest_m = 2.0 * (streets.ring_corner_radius_m + streets.junction_shift_m)
    if min(blocks_m) < smallest_m:
        raise InputError(
            f"streets.block_m: {min(blocks_m):.1f} m is too small for ring_corner_radius_m and junction_shift_m; "
            f"with these a block needs {smallest_m:.1f} m"
        )
    lines_m: Float64Array = np.cumsum([0.0, *blocks_m])
    lines_m -= lines_m[-1] / 2.0
    return lines_m


def _draw_segments(streets: StreetRecipe, rng: np.random.Generator) -> set[tuple[_Node, _Node]]:
    """Pairs of neighbouring nodes with a street between them, the ring's corners excluded."""
    nodes = [_Node(c, r) for c in range(streets.columns + 1) for r in range(streets.rows + 1)]
    steps = [(_Node(c, r), _Node(c + dc, r + dr)) for c, r in nodes for dc, dr in ((1, 0), (0, 1))]
    corners = {(c, r) for c in (0, streets.columns) for r in (0, streets.rows)}
    segments = {(a, b) for a, b in steps if b in nodes and tuple(a) not in corners and tuple(b) not in corners}
    candidates = sorted(segment for segment in segments if _can_be_left_out(streets, *segment))
    thinned: set[_Node] = set()
    left_out = 0
    for index in rng.permutation(len(candidates)):
        a, b = candidates[index]
        # A junction loses one arm at most, so that three remain.
        if left_out < streets.merged_blocks and a not in thinned and b not in thinned:
            segments.remove((a, b))
            thinned.update((a, b))
            left_out += 1
    return segments


def _can_be_left_out(streets: StreetRecipe, a: _Node, b: _Node) -> bool:
    """Only narrow streets between two inner junctions."""
    return _lanes(streets, a, b) == 1 and all(
        0 < node.column < streets.columns and 0 < node.row < streets.rows for node in (a, b)
    )


def _lanes(streets: StreetRecipe, a: _Node, b: _Node) -> int:
    """Lanes per direction of the street between two nodes."""
    wide = a.column in streets.wide_north_south if a.column == b.column else a.row in streets.wide_east_west
    return 2 if wide else 1


def _ring_corner(streets: StreetRecipe, positions: dict[_Node, Float64Array], corner: _Node) -> Street:
    """The street around a corner of the ring, counter-clockwise about the corner's missing junction, as an arc."""
    inward_column = corner.column + (1 if corner.column == 0 else -1)
    inward_row = corner.row + (1 if corner.row == 0 else -1)
    start, end = _Node(inward_column, corner.row), _Node(corner.column, inward_row)
    apex_m, radius_m = positions[corner], streets.ring_corner_radius_m
    to_start = np.sign(positions[start] - apex_m)
    to_end = np.sign(positions[end] - apex_m)
    angle_rad = np.linspace(0.0, np.pi / 2.0, _ARC_STEPS + 1)[:, None]
    arc_m = apex_m + radius_m * ((1.0 - np.sin(angle_rad)) * to_start + (1.0 - np.cos(angle_rad)) * to_end)
    return Street(start.id, end.id, 1, np.concatenate([[positions[start]], arc_m, [positions[end]]]))


def nodes_xml(plan: StreetPlan, recipe: TownRecipe) -> str:
    """SUMO's node file."""
    streets = recipe.streets
    # SUMO rounds the outer edge of the sidewalk; the curb lies one sidewalk's width further out.
    radius_m = max(streets.curb_radius_m - streets.sidewalk_width_m, 0.5)
    root = ElementTree.Element("nodes")
    ElementTree.SubElement(
        root,
        "location",
        netOffset="0.00,0.00",
        convBoundary="0,0,0,0",
        origBoundary="0,0,0,0",
        projParameter=recipe.datum.datum.proj_string,
    )
    for junction, (x_m, y_m) in plan.junctions.items():
        signalised = plan.incoming_lanes(junction) >= streets.signals_from_lanes
        ElementTree.SubElement(
            root,
            "node",
            id=junction,
            x=f"{x_m:.2f}",
            y=f"{y_m:.2f}",
            type="traffic_light" if signalised else "priority",
            radius=f"{radius_m:g}",
        )
    return ElementTree.tostring(root, encoding="unicode")


def edges_xml(plan: StreetPlan, recipe: TownRecipe) -> str:
    """SUMO's edge file: two edges for each street."""
    streets = recipe.streets
    root = ElementTree.Element("edges")
    for street in plan.streets:
        for start, end, line_m in (
            (street.start, street.end, street.line_m),
            (street.end, street.start, street.line_m[::-1]),
        ):
            edge = {
                "id": start + end,
                "from": start,
                "to": end,
                "numLanes": str(street.lanes_per_direction),
                "priority": str(street.lanes_per_direction),
                "speed": f"{streets.speed_limit_kmh / 3.6:.3f}",
                "width": f"{streets.lane_width_m:g}",
                "sidewalkWidth": f"{streets.sidewalk_width_m:g}",
                "shape": " ".join(f"{x_m:.3f},{y_m:.3f}" for x_m, y_m in line_m),
            }
            ElementTree.SubElement(root, "edge", edge)
    return ElementTree.tostring(root, encoding="unicode")
