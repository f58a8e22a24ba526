"""Main roads of a region, along the borders of its cells."""

from itertools import pairwise

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from simbev_ros.maps.plan.patterns.districts import Cell
from simbev_ros.maps.plan.patterns.street_lattice import FINE, Lattice, Point

Border = tuple[Point, Point]


def add_main_roads(
    lattice: Lattice, districts: dict[Cell, str], course: tuple[Point, ...], gaps: float, rng: np.random.Generator
) -> list[Point]:
    """Add roads along all borders of cells, but where the motorway runs and for some between fields.

    Args:
        lattice: To which they are added.
        districts: Use of each cell.
        course: Corners of the motorway's line, in cells; closed if more than two.
        gaps: Share of borders between fields that stay without a road.
        rng: Chooses them.

    Returns:
        Corners of cells where at least three of these roads meet.
    """
    taken = _motorway_borders(course)
    lines = range(lattice.cells + 1)
    borders = [
        ((i, j), (i + a, j + b))
        for i in lines
        for j in lines
        for a, b in ((1, 0), (0, 1))
        if i + a <= lattice.cells and j + b <= lattice.cells
    ]
    borders = [border for border in borders if border not in taken]
    corners = {corner for border in taken for corner in border}
    kinds = {border: _kind(border, districts, corners) for border in borders}
    _leave_out(kinds, gaps, corners, rng)
    for (start, end), kind in kinds.items():
        lattice.add((start[0] * FINE, start[1] * FINE), (end[0] * FINE, end[1] * FINE), kind)
    return [corner for corner, count in sorted(_degrees(kinds).items()) if count >= 3]


def _motorway_borders(course: tuple[Point, ...]) -> set[Border]:
    """Borders of cells along which the motorway runs."""
    ends = [*course, course[0]] if len(course) > 2 else list(course)
    borders = set()
    for (i, j), (k, m) in pairwise(ends):
        count = max(abs(k - i), abs(m - j))
        points = [(i + (k - i) * step // count, j + (m - j) * step // count) for step in range(count + 1)]
        borders |= {(min(a, b), max(a, b)) for a, b in pairwise(points)}
    return borders


def _kind(border: Border, districts: dict[Cell, str], motorway_corners: set[Point]) -> str:
    """Cross-section of a main road, by the cells on both its sides; the same on both sides of a motorway."""
    uses = _uses(border, districts)
    for corner in motorway_corners.intersection(border):
        other = next(point for point in border if point != corner)
        beyond = (2 * corner[0] - other[0], 2 * corner[1] - other[1])
        uses |= _uses((min(corner, beyond), max(corner, beyond)), districts)
    if "downtown" in uses:
        return "avenue"
    if uses & {"residential", "industrial"}:
        return "arterial"
    return "collector" if uses & {"suburb", "park"} else "country"


def _uses(border: Border, districts: dict[Cell, str]) -> set[str]:
    (i, j), (k, _) = border
    cells = ((i, j), (i, j - 1)) if k > i else ((i, j), (i - 1, j))
    return {districts[cell] for cell in cells if cell in districts}


def _leave_out(kinds: dict[Border, str], gaps: float, motorway_corners: set[Point], rng: np.random.Generator) -> None:
    """Remove country roads at random, so that all stay connected and none becomes a dead end."""
    rural = [border for border, kind in kinds.items() if kind == "country"]
    degrees = _degrees(kinds)
    left = round(gaps * len(rural))
    for index in rng.permutation(len(rural)).tolist():
        start, end = border = rural[index]
        if left == 0 or {start, end} & motorway_corners or min(degrees[start], degrees[end]) < 3:
            continue
        others = [other for other in kinds if other != border]
        if _parts(others) == _parts([*others, border]):
            del kinds[border]
            degrees[start] -= 1
            degrees[end] -= 1
            left -= 1


def _parts(borders: list[Border]) -> int:
    """How many parts without connection there are."""
    corners = sorted({corner for border in borders for corner in border})
    index = {corner: number for number, corner in enumerate(corners)}
    pairs = np.array([(index[start], index[end]) for start, end in borders])
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(corners), len(corners)))
    return int(connected_components(graph, directed=False)[0])


def _degrees(kinds: dict[Border, str]) -> dict[Point, int]:
    degrees: dict[Point, int] = {}
    for border in kinds:
        for corner in border:
            degrees[corner] = degrees.get(corner, 0) + 1
    return degrees
