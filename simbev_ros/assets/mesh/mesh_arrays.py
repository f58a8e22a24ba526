"""Many meshes as flat arrays, and back."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields

import numpy as np

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.types import AnyArray


def mesh_arrays(meshes: Sequence[Mesh]) -> Iterator[tuple[str, AnyArray]]:
    """All columns of one or more meshes, end to end, and how long each mesh's are."""
    for field in fields(Mesh):
        columns = [getattr(mesh, field.name) for mesh in meshes]
        yield field.name, np.concatenate(columns)
        yield f"{field.name}_count", np.array([len(column) for column in columns])


def meshes_from(arrays: Mapping[str, AnyArray]) -> list[Mesh]:
    """The meshes, from an open file that has the arrays.

    Raises:
        One of ``errors.NPZ_DAMAGE``: The file is damaged.
    """
    columns = {field.name: _split(arrays, field.name) for field in fields(Mesh)}
    count = len(columns["vertices"])
    return [Mesh(**{name: column[index] for name, column in columns.items()}) for index in range(count)]


def _split(arrays: Mapping[str, AnyArray], name: str) -> list[AnyArray]:
    return np.split(arrays[name], np.cumsum(arrays[f"{name}_count"])[:-1])
