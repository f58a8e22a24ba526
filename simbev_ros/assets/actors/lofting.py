"""Meshes of shells: see ``shell`` for loops, columns and patches."""

import numpy as np
from scipy.interpolate import PchipInterpolator

from simbev_ros.assets.actors.finishes import finish_named, mirrored_name
from simbev_ros.assets.actors.shell import Arch, Curve, Loop, Patch, Shell
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.primitives import patchwork
from simbev_ros.semantics import Tag
from simbev_ros.types import AnyArray, BoolArray, Float64Array

_CAP_CUTS = (0.45, 1.0)
_SEAM = 0.004


def build_shell(shell: Shell, tag: Tag) -> Mesh:
    """The closed mesh of a shell."""
    columns = _columns(shell)
    half = np.stack([_half_loop(shell, loop, columns) for loop in shell.loops])
    for arch in shell.arches:
        _cut(half, arch)
    mirrored = half[:, -2:0:-1] * [1.0, -1.0, 1.0]
    grid = np.concatenate([half, mirrored], axis=1)
    lateral = _laterals(shell)
    surfaces = [
        (_wall_quads(grid), _wall_finishes(shell, columns)),
        (_cap_quads(_cap(shell, half[-1], lateral)), _cap_finishes(shell, columns, lateral)),
        (_cap_quads(_level(half[0], np.array([-1.0, 1.0])))[:, ::-1], np.full(len(columns) - 1, shell.base)),
    ]
    quads = np.concatenate([quads for quads, _ in surfaces])
    names, index = np.unique(np.concatenate([names for _, names in surfaces]), return_inverse=True)
    corners = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return patchwork(
        [finish_named(str(name), tag) for name in names],
        np.repeat(index, 2),
        corners,
        np.arange(len(corners), dtype=np.int32).reshape(-1, 3),
        crease_deg=shell.crease_deg,
    )


def _columns(shell: Shell) -> Float64Array:
    """(K,) ascending: 0..1 on the front, 1..2 on the side (share of its length), 2..3 on the rear."""
    start, end = shell.sides[0], shell.sides[-1]
    side_x: list[float] = [x for patch in shell.patches for x in patch.side]
    for arch in shell.arches:
        angles = np.linspace(0.0, np.pi, 8)
        side_x += [*(arch.x + arch.radius * np.cos(angles)), arch.x + arch.radius * 1.012, arch.x - arch.radius * 1.012]
    if shell.recess:
        front, rear = shell.recess.x
        side_x += [front, front - _SEAM, rear, rear + _SEAM]
    columns = [
        np.linspace(0.0, 1.0, shell.front + 1),
        1.0 + np.linspace(0.0, 1.0, shell.side + 1),
        2.0 + np.linspace(0.0, 1.0, shell.rear + 1),
        np.array([value for patch in shell.patches for value in patch.front]),
        1.0 + (np.array(side_x) - start) / (end - start),
        2.0 + np.array([value for patch in shell.patches for value in patch.rear]),
    ]
    wanted = np.unique(np.round(np.concatenate(columns), 6))
    asked = np.unique(np.round(np.concatenate([*columns[3:], [0.0, 1.0, 2.0, 3.0]]), 6))
    distance = np.abs(wanted[:, None] - asked[None, :]).min(axis=1)
    return np.asarray(wanted[(distance == 0.0) | (distance > 0.02)])


def _half_loop(shell: Shell, loop: Loop, columns: Float64Array) -> Float64Array:
    """(K, 3) points of the left half of a loop, front to rear."""
    places = loop.sides or shell.sides
    start, end = places[0], places[-1]
    half_width = _curve(loop.half)
    xy = np.empty((len(columns), 2))
    front, rear = columns <= 1.0, columns >= 2.0
    side = ~front & ~rear
    xy[front] = _corner(loop.front, start, float(half_width(start)), loop.nose, columns[front])
    x = shell.sides[0] + (columns[side] - 1.0) * (shell.sides[-1] - shell.sides[0])
    xy[side, 0] = np.interp(-x, -np.array(shell.sides), np.array(places))
    xy[side, 1] = half_width(xy[side, 0])
    xy[rear] = _corner(loop.rear, end, float(half_width(end)), loop.tail, 3.0 - columns[rear])
    return np.column_stack([xy, _curve(loop.z)(xy[:, 0])])


def _cut(half: Float64Array, arch: Arch) -> None:
    """Lift, in place, what is below an arch of (L, K, 3) loops to its circle on the surface."""
    x, y, z = np.moveaxis(half, 2, 0).copy()
    for column in np.flatnonzero(np.abs(x[2] - arch.x) <= arch.radius + 1e-6):
        top = arch.z + np.sqrt(max(arch.radius**2 - (x[2, column] - arch.x) ** 2, 0.0))
        lifted = np.flatnonzero(z[1:, column] < top) + 1
        half[lifted, column, 2] = top
        half[lifted[1:], column, 1] = np.interp(top, z[2:, column], y[2:, column])


def _corner(tip: float, start: float, half_width: float, exponent: float, share: Float64Array) -> Float64Array:
    """(N, 2) points of a superellipse quarter from the middle (share 0) to the side (share 1), by length along it."""
    angle = np.linspace(0.0, np.pi / 2.0, 400)
    x = start + (tip - start) * np.cos(angle) ** (2.0 / exponent)
    y = half_width * np.sin(angle) ** (2.0 / exponent)
    x[-1], y[0] = start, 0.0
    length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    return np.column_stack([np.interp(share * length[-1], length, x), np.interp(share * length[-1], length, y)])


def _curve(curve: Curve) -> PchipInterpolator:
    """A smooth function of x without overshoot, constant beyond its ends."""
    points = np.array([(0.0, curve)] if isinstance(curve, float | int) else sorted(curve), np.float64)
    x, value = points.T
    return PchipInterpolator(
        np.concatenate([[x[0] - 100.0, x[0] - 50.0], x, [x[-1] + 50.0, x[-1] + 100.0]]),
        np.concatenate([[value[0]] * 2, value, [value[-1]] * 2]),
    )


def _wall_quads(grid: Float64Array) -> Float64Array:
    """((L - 1) * M, 4, 3) cells between successive loops, counter-clockwise from outside."""
    following = np.roll(grid, -1, axis=1)
    return np.stack([grid[:-1], following[:-1], following[1:], grid[1:]], axis=2).reshape(-1, 4, 3)


def _cap_quads(cap: Float64Array) -> Float64Array:
    """((K - 1) * (F - 1), 4, 3) cells of a (K, F, 3) cap, counter-clockwise from above."""
    return np.stack([cap[:-1, :-1], cap[:-1, 1:], cap[1:, 1:], cap[1:, :-1]], axis=2).reshape(-1, 4, 3)


def _level(half: Float64Array, lateral: Float64Array) -> Float64Array:
    """(K, F, 3) points across a loop, right to left."""
    across = np.repeat(half[:, None, :], len(lateral), axis=1)
    across[..., 1] *= lateral
    return across


def _cap(shell: Shell, half: Float64Array, lateral: Float64Array) -> Float64Array:
    """(K, F, 3) points of the crowned cap."""
    cap = _level(half, lateral)
    rise = (half[:, 1, None] ** 2 - cap[..., 1] ** 2) / half[:, 1].max() ** 2
    cap[..., 2] += shell.crown * rise
    if shell.recess:
        front, rear = shell.recess.x
        inside = (cap[..., 0] < front - _SEAM / 2) & (cap[..., 0] > rear + _SEAM / 2)
        cap[inside & (np.abs(lateral) <= shell.recess.lateral + 1e-6), 2] = shell.recess.z
    return cap


def _laterals(shell: Shell) -> Float64Array:
    """(F,) -1..1: where the cap is cut lengthwise."""
    cuts = [
        *_CAP_CUTS,
        *(v for p in shell.patches if p.rows is None for v in p.lateral),
    ]
    if shell.recess:
        cuts += [shell.recess.lateral, shell.recess.lateral + 0.01]
    return np.unique(np.round([*cuts, *(-cut for cut in cuts)], 6))


def _in_ranges(patch: Patch, shell: Shell, columns: Float64Array) -> BoolArray:
    """(K - 1,) which cells between columns a patch covers."""
    start, end = shell.sides[0], shell.sides[-1]
    sides = 1.0 + (np.array(patch.side) - start) / (end - start)
    bounds = np.concatenate([patch.front, sides, 2.0 + np.array(patch.rear)]).reshape(-1, 2)
    middle = (columns[:-1] + columns[1:]) / 2.0
    inside = (middle[:, None] > bounds[:, 0]) & (middle[:, None] < bounds[:, 1])
    return np.asarray(inside.any(axis=1))


def _wall_finishes(shell: Shell, columns: Float64Array) -> AnyArray:
    """((L - 1) * M,) finish names of the wall's cells."""
    cells = len(columns) - 1
    left = np.full((len(shell.loops) - 1, cells), shell.finish, dtype=object)
    right = left.copy()
    row_of = {loop.name: row for row, loop in enumerate(shell.loops)}
    for patch in shell.patches:
        if patch.rows is None:
            continue
        rows = slice(row_of[patch.rows[0]], row_of[patch.rows[1]])
        inside = _in_ranges(patch, shell, columns)
        if patch.only != "right":
            left[rows, inside] = patch.finish
        if patch.only != "left":
            right[rows, inside] = mirrored_name(patch.finish)
    return np.concatenate([left, right[:, ::-1]], axis=1).astype(str).reshape(-1)


def _cap_finishes(shell: Shell, columns: Float64Array, lateral: Float64Array) -> AnyArray:
    """((K - 1) * (F - 1),) finish names of the cap's cells."""
    names = np.full((len(columns) - 1, len(lateral) - 1), shell.cap, dtype=object)
    middle = np.abs(lateral[:-1] + lateral[1:]) / 2.0
    for patch in shell.patches:
        if patch.rows is None:
            across = (middle > patch.lateral[0]) & (middle < patch.lateral[1])
            names[np.ix_(_in_ranges(patch, shell, columns), across)] = patch.finish
    return names.astype(str).reshape(-1)
