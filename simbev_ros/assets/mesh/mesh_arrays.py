"""Converts lists of meshes to named flat arrays for NPZ files, and back."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields

import numpy as np

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.foundation.types import AnyArray


def mesh_arrays(meshes: Sequence[Mesh]) -> Iterator[tuple[str, AnyArray]]:
    """Named arrays of one or more meshes: each column of all meshes concatenated, and its length per mesh."""
    for field in fields(Mesh):
        columns = [getattr(mesh, field.name) for mesh in meshes]
        yield field.name, np.concatenate(columns)
        yield f"{field.name}_count", np.array([len(column) for column in columns])


def meshes_from(arrays: Mapping[str, AnyArray]) -> list[Mesh]:
    """Meshes from an open NPZ file with the arrays of ``mesh_arrays``.

    Raises:
        One of ``foundation.errors.NPZ_DAMAGE``: The file is damaged.
    """
    columns = {field.name: _split(arrays, field.name) for field in fields(Mesh)}
    count = len(columns["vertices"])
    return [Mesh(**{name: column[index] for name, column in columns.items()}) for index in range(count)]


def _split(arrays: Mapping[str, AnyArray], name: str) -> list[AnyArray]:
    return np.split(arrays[name], np.cumsum(arrays[f"{name}_count"])[:-1])
