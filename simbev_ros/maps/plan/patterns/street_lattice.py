"""The street lattice of a region: each cell is filled with streets that suit its use.

A cell is a square of ``FINE`` × ``FINE`` lattice steps between the region's main roads, which run along the cells'
borders. All streets run between adjacent points of the lattice, so they can meet only at lattice points.
"""

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

from simbev_ros.foundation.types import Float64Array

FINE = 8
"""Lattice steps along a cell's side."""

_LOOP_FRACTION = 0.1  # fraction of a suburb's steps that close a loop

Point = tuple[int, int]
Step = tuple[Point, Point]


@dataclass
class Lattice:
    """Streets as steps between lattice points.

    Attributes:
        cells: Number of cells along a side of the region.
        steps: Kind of street between two adjacent points, the lower point first.
        shift: Displacement of a point from the lattice, in steps.
    """

    cells: int
    steps: dict[Step, str] = field(default_factory=dict)
    shift: dict[Point, Float64Array] = field(default_factory=dict)

    def add(self, a: Point, b: Point, kind: str) -> None:
        """Add streets between two points on one line of the lattice; existing steps keep their kind."""
        count = max(abs(b[0] - a[0]), abs(b[1] - a[1]))
        along = ((b[0] - a[0]) // count, (b[1] - a[1]) // count)
        for k in range(count):
            point = (a[0] + k * along[0], a[1] + k * along[1])
            next_point = (point[0] + along[0], point[1] + along[1])
            self.steps.setdefault((min(point, next_point), max(point, next_point)), kind)

    def remove_step(self, a: Point, b: Point) -> None:
        """Remove the street between two adjacent points."""
        self.steps.pop((min(a, b), max(a, b)), None)

    def arms(self) -> dict[Point, list[Point]]:
        """Adjacent points that each point has a street to, in order."""
        arms: dict[Point, list[Point]] = defaultdict(list)
        for a, b in sorted(self.steps):
            arms[a].append(b)
            arms[b].append(a)
        return arms

    def corners_of(self, chain: list[Point]) -> Float64Array:
        """(N, 2) corners of a chain's line, in lattice steps."""
        positions = np.array([np.array(point) + self.shift.get(point, 0.0) for point in chain])
        before, after = positions[1:-1] - positions[:-2], positions[2:] - positions[1:-1]
        straight = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]) < 1e-9
        return np.asarray(positions[~np.concatenate([[False], straight, [False]])])

    def prune(self, *kinds: str) -> None:
        """Remove dead ends of these kinds, from junction to end."""
        while True:
            arms = self.arms()
            stubs = [s for s, kind in self.steps.items() if kind in kinds and 1 in (len(arms[s[0]]), len(arms[s[1]]))]
            if not stubs:
                return
            for stub in stubs:
                del self.steps[stub]

    def keep_largest_part(self) -> None:
        """Remove all steps outside the largest connected component."""
        points = sorted({point for step in self.steps for point in step})
        index = {point: k for k, point in enumerate(points)}
        pairs = np.array([(index[a], index[b]) for a, b in sorted(self.steps)])
        graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
        label = connected_components(graph, directed=False)[1]
        largest = np.argmax(np.bincount(label))
        self.steps = {step: kind for step, kind in self.steps.items() if label[index[step[0]]] == largest}

    def chains(self) -> list[tuple[str, list[Point]]]:
        """Streets from junction to junction, or to a dead end or a change of kind; each step belongs to one of them."""
        arms = self.arms()
        remaining = dict(sorted(self.steps.items()))
        through = {point for point in arms if self._is_passed_through(point, arms[point])}
        starts = [point for point in sorted(arms) if point not in through]
        chains = []
        for start in (*starts, *sorted(through)):
            for neighbor in arms[start]:
                if (min(start, neighbor), max(start, neighbor)) not in remaining:
                    continue
                chain = [start, neighbor]
                kind = remaining.pop((min(start, neighbor), max(start, neighbor)))
                while chain[-1] in through and chain[-1] != start:
                    onward = next(point for point in arms[chain[-1]] if point != chain[-2])
                    remaining.pop((min(chain[-1], onward), max(chain[-1], onward)))
                    chain.append(onward)
                chains.append((kind, chain))
        return chains

    def _is_passed_through(self, point: Point, arms: list[Point]) -> bool:
        """Whether a street continues at a point: streets end at junctions, and change kind only where straight."""
        if len(arms) != 2:
            return False
        kinds = {self.steps[min(point, arm), max(point, arm)] for arm in arms}
        turns = arms[0][0] != arms[1][0] and arms[0][1] != arms[1][1]
        return len(kinds) == 1 or turns


def fill_downtown(lattice: Lattice, cell: Point, rng: np.random.Generator) -> None:
    """Fill a cell with a dense grid; some streets are left out to form larger blocks."""
    _fill_grid(lattice, cell, (1, 1), "downtown", 0.12, rng)


def fill_residential(lattice: Lattice, cell: Point, rng: np.random.Generator) -> None:
    """Fill a cell with long narrow blocks in either direction."""
    spacing = (1, 2) if rng.random() < 0.5 else (2, 1)
    _fill_grid(lattice, cell, spacing, "residential", 0.1, rng)


def fill_industrial(lattice: Lattice, cell: Point, rng: np.random.Generator) -> None:
    """Fill a cell with large blocks."""
    _fill_grid(lattice, cell, (2, 4) if rng.random() < 0.5 else (4, 2), "industrial", 0.0, rng)


def _fill_grid(
    lattice: Lattice,
    cell: Point,
    spacing: tuple[int, int],
    kind: str,
    omitted_fraction: float,
    rng: np.random.Generator,
) -> None:
    corner = (cell[0] * FINE, cell[1] * FINE)
    runs = []
    for i in range(0, FINE + 1, spacing[0]):
        for j in range(0, FINE, spacing[1]):
            if 0 < i < FINE:
                runs.append(((corner[0] + i, corner[1] + j), (corner[0] + i, corner[1] + j + spacing[1])))
    for j in range(0, FINE + 1, spacing[1]):
        for i in range(0, FINE, spacing[0]):
            if 0 < j < FINE:
                runs.append(((corner[0] + i, corner[1] + j), (corner[0] + i + spacing[0], corner[1] + j)))
    for run, draw in zip(runs, rng.random(len(runs)), strict=True):
        if draw >= omitted_fraction:
            lattice.add(*run, kind)


def fill_suburb(lattice: Lattice, cell: Point, rng: np.random.Generator) -> None:
    """Fill a cell with a collector road through its middle, and winding streets, loops and culs-de-sac off it."""
    corner = (cell[0] * FINE, cell[1] * FINE)
    low, high = (int(value) for value in rng.permutation([2, 6]))
    collector = (((0, low), (4, low)), ((4, low), (4, high)), ((4, high), (FINE, high)))
    entries = (((low, 0), (low, 2)), ((high, FINE), (high, 6)), ((0, high), (2, high)), ((FINE, low), (6, low)))
    for kind, runs in (("collector", collector), ("suburb", entries)):
        for a, b in runs:
            lattice.add(_translate(a, corner), _translate(b, corner), kind)
    inner = [(corner[0] + i, corner[1] + j) for i in range(1, FINE) for j in range(1, FINE)]
    for a, b in _draw_spanning_tree(lattice, inner, rng):
        lattice.add(a, b, "suburb")
    for point in inner:
        lattice.shift[point] = rng.uniform(-0.22, 0.22, 2)


def _translate(point: Point, by: Point) -> Point:
    return point[0] + by[0], point[1] + by[1]


def _draw_spanning_tree(lattice: Lattice, points: list[Point], rng: np.random.Generator) -> list[Step]:
    """Draw a random spanning tree over points, preferring existing streets, plus a few additional steps."""
    index = {point: number for number, point in enumerate(points)}
    steps = [
        (point, neighbor)
        for point in points
        for neighbor in ((point[0] + 1, point[1]), (point[0], point[1] + 1))
        if neighbor in index
    ]
    cost = rng.uniform(0.5, 1.5, len(steps))
    cost[[step in lattice.steps for step in steps]] = 1e-3
    ends = np.array([(index[a], index[b]) for a, b in steps])
    graph = coo_array((cost, (ends[:, 0], ends[:, 1])), shape=(len(points), len(points)))
    rows, columns = minimum_spanning_tree(graph.tocsr()).nonzero()
    tree = {(points[a], points[b]) for a, b in zip(rows.tolist(), columns.tolist(), strict=True)}
    is_extra = rng.random(len(steps)) < _LOOP_FRACTION
    return [step for step, extra in zip(steps, is_extra.tolist(), strict=True) if extra or step in tree]


def fill_village(lattice: Lattice, node: Point, rng: np.random.Generator) -> None:
    """Add village lanes around a crossing of country roads."""
    column, row = node
    reach = int(rng.integers(2, 4))
    for i, j in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        if rng.random() < 0.75:
            lattice.add((column + i, row), (column + i, row + j), "village")
            lattice.add((column, row + j), (column + i, row + j), "village")
            lattice.shift[column + i, row + j] = rng.uniform(-0.25, 0.25, 2)
        if rng.random() < 0.5:
            lattice.add((column + i * reach, row), (column + i * reach, row + j), "village")


def fill_farmland(lattice: Lattice, cell: Point, rng: np.random.Generator) -> None:
    """Add up to two farm tracks from a country road to a farmstead."""
    for _ in range(int(rng.integers(0, 3))):
        along, depth = int(rng.integers(3, FINE - 2)), int(rng.integers(2, 4))
        lattice.add((cell[0] * FINE + along, cell[1] * FINE), (cell[0] * FINE + along, cell[1] * FINE + depth), "track")


FILL = {
    "downtown": fill_downtown,
    "residential": fill_residential,
    "suburb": fill_suburb,
    "industrial": fill_industrial,
    "farmland": fill_farmland,
}
"""Use of a cell → function that fills it; cells of other uses stay empty."""
