"""Builds the meshes of vehicle bodies from their shells; ``shell`` defines loops, columns, patches and panels."""

import numpy as np

from simbev_ros.assets.actors.detail import Detail
from simbev_ros.assets.actors.doors import insides
from simbev_ros.assets.actors.finishes import finish_named
from simbev_ros.assets.actors.shell import Shell
from simbev_ros.assets.actors.shell_grid import level_points, shell_grid
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import patchwork
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import AnyArray, Float64Array


def build_shell(shell: Shell, tag: Tag, part_index: dict[str, int], detail: Detail) -> list[Mesh]:
    """Build the closed mesh of a shell and the interior behind its doors.

    Args:
        shell: Shell of a vehicle.
        tag: Semantic tag of all triangles.
        part_index: Index of each rigid part by name.
        detail: Level of detail.
    """
    grid = shell_grid(shell, detail)
    mirrored = grid.half[:, -2:0:-1] * [1.0, -1.0, 1.0]
    wall = _wall_quads(np.concatenate([grid.half, mirrored], axis=1))
    base = _cap_quads(level_points(grid.half[0], np.array([-1.0, 1.0])))[:, ::-1]
    quads = np.concatenate([wall, _cap_quads(grid.cap), base])
    finishes, parts = (
        _flatten_names(grid.finishes, shell.base, len(base)),
        _flatten_names(grid.parts, "body", len(base)),
    )
    meshes = [_mesh_from_quads(quads, finishes, parts, tag, part_index, shell.crease_deg)]
    for part in sorted(set(parts.tolist()) - {"body"}) if detail.insides else ():
        is_door = parts == part
        leaf, niche = insides(quads[is_door])
        skin = np.where(finishes[is_door] == "glass", "glass", "lining")
        lining = np.full(len(leaf) - len(skin), "lining")
        meshes.append(_mesh_from_quads(leaf, np.concatenate([skin, lining]), np.full(len(leaf), part), tag, part_index))
        meshes.append(
            _mesh_from_quads(niche, np.full(len(niche), "lining"), np.full(len(niche), "body"), tag, part_index)
        )
    return meshes


def _mesh_from_quads(
    quads: Float64Array,
    finishes: AnyArray,
    parts: AnyArray,
    tag: Tag,
    part_index: dict[str, int],
    crease_deg: float = 33.0,
) -> Mesh:
    """Mesh of (Q, 4, 3) quads with (Q,) names of finishes and of parts."""
    kinds, index = np.unique(np.stack([finishes, parts]), axis=1, return_inverse=True)
    corners = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return patchwork(
        [finish_named(str(finish), tag, part_index[str(part)]) for finish, part in kinds.T],
        np.repeat(index.reshape(-1), 2),
        corners,
        np.arange(len(corners), dtype=np.int32).reshape(-1, 3),
        crease_deg=crease_deg,
    )


def _wall_quads(grid: Float64Array) -> Float64Array:
    """((L - 1) * M, 4, 3) cells between successive loops, counter-clockwise from outside."""
    following = np.roll(grid, -1, axis=1)
    return np.stack([grid[:-1], following[:-1], following[1:], grid[1:]], axis=2).reshape(-1, 4, 3)


def _cap_quads(cap: Float64Array) -> Float64Array:
    """((K - 1) * (F - 1), 4, 3) cells of a (K, F, 3) cap, counter-clockwise from above."""
    return np.stack([cap[:-1, :-1], cap[:-1, 1:], cap[1:, 1:], cap[1:, :-1]], axis=2).reshape(-1, 4, 3)


def _flatten_names(names: tuple[AnyArray, AnyArray, AnyArray], below: str, count: int) -> AnyArray:
    """(Q,) names of all quads, in the order wall, cap, base."""
    left, right, cap = names
    wall = np.concatenate([left, right[:, ::-1]], axis=1)
    return np.concatenate([wall.reshape(-1), cap.reshape(-1), [below] * count]).astype(str)
