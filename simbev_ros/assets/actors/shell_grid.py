"""Computes the grid of a shell, loops x columns: positions of its points, finishes and parts of its cells."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import TYPE_CHECKING

import numpy as np

from simbev_ros.assets.actors.detail import Detail, select_lines
from simbev_ros.assets.actors.doors import door_part
from simbev_ros.assets.actors.finishes import mirrored_name
from simbev_ros.assets.actors.shell import Arch, Area, Curve, Loop, Seam, Shell
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

_CAP_CUTS = (0.45, 1.0)
_LEDGE = 0.004
_CROWN_RUN = 4.0
"""Distance from the ends of a cap within which it reaches its crown, over the crown's height."""
_SEAM_WIDTHS = ((0.0, "seam", 0.018), (0.005, "soft_seam", 0.026))
"""Maximum error, finish and width of seams per level: about a pixel wide, and fainter in coarser levels."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Grid of a shell: the left half of its wall, and its cap, cut along all required loops and columns.

    Attributes:
        half: (L, K, 3) points of the wall, front to rear.
        cap: (K, F, 3) points of the cap, right to left.
        finishes: Finishes of cells: (L - 1, K - 1) of the left wall, of the right wall, and (K - 1, F - 1) of the cap.
        parts: Parts of cells, in the same layout.
    """

    half: Float64Array
    cap: Float64Array
    finishes: tuple[AnyArray, AnyArray, AnyArray]
    parts: tuple[AnyArray, AnyArray, AnyArray]


def shell_grid(shell: Shell, detail: Detail) -> Grid:
    """Compute the grid of a shell in a level of detail."""
    seams, finish, width_m = _seams(shell, detail)
    areas = [_seam_area(shell, seam, width_m) for seam in seams]
    columns = _columns(shell, areas)
    half = np.stack([_half_loop(shell, loop, columns) for loop in shell.loops])
    for arch in shell.arches:
        _cut(half, arch)
    rows = [loop.name for loop in shell.loops]
    for seam in seams:
        if seam.rows or _under(seam) in rows:
            continue
        index = rows.index(seam.below)
        down = half[index - 1] - half[index]
        share = np.minimum(0.5, width_m / np.maximum(np.linalg.norm(down, axis=1, keepdims=True), 1e-6))
        half = np.insert(half, index, half[index] + share * down, axis=0)
        rows.insert(index, _under(seam))
    lateral = _laterals(shell)
    lines = [(area, finish) for area in areas]
    patches = [(patch, patch.finish) for patch in shell.patches]
    doors = [(panel, door_part(panel.door, "left")) for panel in shell.panels]
    rims = [(_rim(panel, panel.rim, 1.0), door_part(panel.door, "left")) for panel in shell.panels if panel.rim]
    under = [(_rim(panel, 0.0, panel.rim), "lining") for panel in shell.panels if panel.rim]
    names = partial(_names, shell, rows, columns, lateral)
    grid = Grid(
        half=half,
        cap=_cap(shell, half[-1], lateral),
        finishes=names([*patches, *lines, *(under if detail.insides else [])], (shell.finish, shell.cap)),
        parts=names([*doors, *rims], ("body", "body")),
    )
    return _coarser(grid, detail.error_m) if detail.error_m > 0.0 else grid


def _coarser(grid: Grid, error_m: float) -> Grid:
    """Grid without the loops and columns that are not needed within an error."""
    left, right, cap = (np.stack(names) for names in zip(grid.finishes, grid.parts, strict=True))
    wall = np.concatenate([left, right])
    over = np.swapaxes(cap, 1, 2)
    beside = np.concatenate([wall.reshape(-1, wall.shape[2]), over.reshape(-1, over.shape[2])])
    across = np.concatenate([np.swapaxes(grid.half, 0, 1), grid.cap], axis=1)
    column, cells = select_lines(across, _borders(beside), error_m)
    upward = np.swapaxes(wall[..., cells], 1, 2).reshape(-1, wall.shape[1])
    row, levels = select_lines(grid.half[:, column], _borders(upward), error_m)
    sideward = cap[:, cells].reshape(-1, cap.shape[2])
    lateral, strips = select_lines(np.swapaxes(grid.cap[column], 0, 1), _borders(sideward), error_m)

    def select_cells(names: tuple[AnyArray, AnyArray, AnyArray]) -> tuple[AnyArray, AnyArray, AnyArray]:
        left, right, cap = names
        return left[np.ix_(levels, cells)], right[np.ix_(levels, cells)], cap[np.ix_(cells, strips)]

    return Grid(
        half=grid.half[row][:, column],
        cap=grid.cap[column][:, lateral],
        finishes=select_cells(grid.finishes),
        parts=select_cells(grid.parts),
    )


def _borders(names: AnyArray) -> BoolArray:
    """(N + 1,) whether any name changes between neighboring columns of (M, N) cells."""
    return np.concatenate([[True], (names[:, 1:] != names[:, :-1]).any(axis=0), [True]])


def _seams(shell: Shell, detail: Detail) -> tuple[tuple[Seam, ...], str, float]:
    """Seams of a level of detail, with their finish and width; none if they are too fine to show."""
    for error_m, finish, width_m in _SEAM_WIDTHS:
        if detail.error_m <= error_m:
            return shell.seams, finish, width_m
    return (), "", 0.0


def _under(seam: Seam) -> str:
    """Name of the loop at the lower edge of a horizontal seam."""
    return f"under {seam.below}"


def _seam_area(shell: Shell, seam: Seam, width_m: float) -> Area:
    """Cells of a seam."""
    if not seam.rows:
        return Area(rows=(_under(seam), seam.below), front=seam.front, side=seam.side, rear=seam.rear, only=seam.only)
    return Area(rows=seam.rows, only=seam.only, **_seam_ranges(shell, seam, width_m))


def _seam_ranges(shell: Shell, seam: Seam, width_m: float) -> dict[str, tuple[float, ...]]:
    """Ranges of cells around the positions of a vertical seam."""
    loop = shell.loops[len(shell.loops) // 2]
    half_width = float(_curve(loop.half)(shell.sides[0]))
    front_m, rear_m = half_width + loop.front - shell.sides[0], half_width + shell.sides[-1] - loop.rear
    return {
        name: tuple(edge for target in x_breaks for edge in (target - step, target + step))
        for name, x_breaks, step in (
            ("front", seam.front, 0.6 * width_m / front_m),
            ("side", seam.side, -0.5 * width_m),
            ("rear", seam.rear, 0.6 * width_m / rear_m),
        )
    }


def _columns(shell: Shell, seams: Sequence[Area]) -> Float64Array:
    """(K,) ascending column parameters: 0..1 on the front, 1..2 on the side (share of its length), 2..3 on the rear."""
    start, end = shell.sides[0], shell.sides[-1]
    side_x: list[float] = [x for area in (*shell.patches, *shell.panels, *seams) for x in area.side]
    for arch in shell.arches:
        angles = np.linspace(0.0, np.pi, 8)
        side_x += [*(arch.x + arch.radius * np.cos(angles)), arch.x + arch.radius * 1.012, arch.x - arch.radius * 1.012]
    if shell.recess:
        front, rear = shell.recess.x
        side_x += [front, front - _LEDGE, rear, rear + _LEDGE]
    columns = [
        np.linspace(0.0, 1.0, shell.front + 1),
        1.0 + np.linspace(0.0, 1.0, shell.side + 1),
        2.0 + np.linspace(0.0, 1.0, shell.rear + 1),
        np.array([value for area in (*shell.patches, *seams) for value in area.front]),
        1.0 + (np.array(side_x) - start) / (end - start),
        2.0 + np.array([value for area in (*shell.patches, *seams) for value in area.rear]),
    ]
    wanted = np.unique(np.round(np.concatenate(columns), 6))
    required = np.unique(np.round(np.concatenate([*columns[3:], [0.0, 1.0, 2.0, 3.0]]), 6))
    distance = np.abs(wanted[:, None] - required[None, :]).min(axis=1)
    return np.asarray(wanted[(distance == 0.0) | (distance > 0.02)])


def _half_loop(shell: Shell, loop: Loop, columns: Float64Array) -> Float64Array:
    """(K, 3) points of the left half of a loop, front to rear."""
    x_breaks = loop.sides or shell.sides
    start, end = x_breaks[0], x_breaks[-1]
    half_width = _curve(loop.half)
    xy = np.empty((len(columns), 2))
    front, rear = columns <= 1.0, columns >= 2.0
    side = ~front & ~rear
    xy[front] = _corner(loop.front, start, float(half_width(start)), loop.nose, columns[front])
    x = shell.sides[0] + (columns[side] - 1.0) * (shell.sides[-1] - shell.sides[0])
    xy[side, 0] = np.interp(-x, -np.array(shell.sides), np.array(x_breaks))
    xy[side, 1] = half_width(xy[side, 0])
    xy[rear] = _corner(loop.rear, end, float(half_width(end)), loop.tail, 3.0 - columns[rear])
    return np.column_stack([xy, _curve(loop.z)(xy[:, 0])])


def _cut(half: Float64Array, arch: Arch) -> None:
    """Raise, in place, the points of (L, K, 3) loops below an arch to its circle on the surface."""
    x, y, z = np.moveaxis(half, 2, 0).copy()
    for column in np.flatnonzero(np.abs(x[2] - arch.x) <= arch.radius + 1e-6):
        top = arch.z + np.sqrt(max(arch.radius**2 - (x[2, column] - arch.x) ** 2, 0.0))
        lifted = np.flatnonzero(z[1:, column] < top) + 1
        half[lifted, column, 2] = top
        half[lifted[1:], column, 1] = np.interp(top, z[2:, column], y[2:, column])


def _corner(tip: float, start: float, half_width: float, exponent: float, share: Float64Array) -> Float64Array:
    """(N, 2) points of a quarter superellipse at shares of its length, from the middle (0) to the side (1)."""
    angle = np.linspace(0.0, np.pi / 2.0, 400)
    x = start + (tip - start) * np.cos(angle) ** (2.0 / exponent)
    y = half_width * np.sin(angle) ** (2.0 / exponent)
    x[-1], y[0] = start, 0.0
    length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    return np.column_stack([np.interp(share * length[-1], length, x), np.interp(share * length[-1], length, y)])


@lru_cache(maxsize=4096)
def _curve(curve: Curve) -> "PchipInterpolator":
    """Smooth function of x without overshoot, constant beyond its ends."""
    from scipy.interpolate import PchipInterpolator  # takes long to load; only those who build models need it

    points = np.array([(0.0, curve)] if isinstance(curve, float | int) else sorted(curve), np.float64)
    x, value = points.T
    return PchipInterpolator(
        np.concatenate([[x[0] - 100.0, x[0] - 50.0], x, [x[-1] + 50.0, x[-1] + 100.0]]),
        np.concatenate([[value[0]] * 2, value, [value[-1]] * 2]),
    )


def level_points(half: Float64Array, lateral: Float64Array) -> Float64Array:
    """(K, F, 3) points across a loop, right to left."""
    across = np.repeat(half[:, None, :], len(lateral), axis=1)
    across[..., 1] *= lateral
    return across


def _cap(shell: Shell, half: Float64Array, lateral: Float64Array) -> Float64Array:
    """(K, F, 3) points of the crowned cap."""
    cap = level_points(half, lateral)
    rise = (half[:, 1, None] ** 2 - cap[..., 1] ** 2) / half[:, 1].max() ** 2
    inward = np.minimum(half[0, 0] - cap[..., 0], cap[..., 0] - half[-1, 0])  # avoids a step at nearly straight ends
    cap[..., 2] += shell.crown * np.minimum(rise, inward / (_CROWN_RUN * max(shell.crown, 1e-6)))
    if shell.recess:
        front, rear = shell.recess.x
        inside = (cap[..., 0] < front - _LEDGE / 2) & (cap[..., 0] > rear + _LEDGE / 2)
        cap[inside & (np.abs(lateral) <= shell.recess.lateral + 1e-6), 2] = shell.recess.z
    return cap


def _laterals(shell: Shell) -> Float64Array:
    """(F,) shares of the half width, -1..1, where the cap is cut lengthwise."""
    cuts = [
        *_CAP_CUTS,
        *(v for p in shell.patches if p.rows is None for v in p.lateral),
        *(panel.rim for panel in shell.panels if panel.rim),
    ]
    if shell.recess:
        cuts += [shell.recess.lateral, shell.recess.lateral + 0.01]
    return np.unique(np.round([*cuts, *(-cut for cut in cuts)], 6))


def _in_ranges(area: Area, shell: Shell, columns: Float64Array) -> BoolArray:
    """(K - 1,) whether an area covers each cell between columns."""
    start, end = shell.sides[0], shell.sides[-1]
    sides = 1.0 + (np.array(area.side) - start) / (end - start)
    bounds = np.concatenate([area.front, sides, 2.0 + np.array(area.rear)]).reshape(-1, 2)
    middle = (columns[:-1] + columns[1:]) / 2.0
    inside = (middle[:, None] > bounds[:, 0]) & (middle[:, None] < bounds[:, 1])
    return np.asarray(inside.any(axis=1))


def _rim(area: Area, start: float, end: float) -> Area:
    """Area of the cap beside an area of the wall, between two shares of the half width."""
    return Area(side=area.side, lateral=(start, end))


def _names(
    shell: Shell,
    rows: Sequence[str],
    columns: Float64Array,
    lateral: Float64Array,
    areas: Iterable[tuple[Area, str]],
    elsewhere: tuple[str, str],
) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Names of cells, in the layout of ``Grid``: later areas override; ``elsewhere`` names other wall and cap cells."""
    cells, middle = len(columns) - 1, (lateral[:-1] + lateral[1:]) / 2.0
    left = np.full((len(rows) - 1, cells), elsewhere[0], dtype=object)
    right, cap = left.copy(), np.full((cells, len(middle)), elsewhere[1], dtype=object)
    for area, name in areas:
        inside = _in_ranges(area, shell, columns)
        if area.rows is None:
            across = (np.abs(middle) > area.lateral[0]) & (np.abs(middle) < area.lateral[1])
            cap[np.ix_(inside, across & (middle >= 0.0))] = name
            cap[np.ix_(inside, across & (middle < 0.0))] = mirrored_name(name)
            continue
        target = slice(rows.index(area.rows[0]), rows.index(area.rows[1]))
        if area.only != "right":
            left[target, inside] = name
        if area.only != "left":
            right[target, inside] = mirrored_name(name)
    return left, right, cap
