"""Meshes in two levels of detail: exact, and with fewer triangles for distant cameras."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from simbev_ros.assets.mesh.mesh import Mesh


@dataclass(frozen=True, slots=True, eq=False)
class GradedMesh:
    """Exact mesh of an object and its simplified stand-in.

    Attributes:
        mesh: Mesh that nearby cameras see, rays hit and labels describe.
        coarse: Mesh that distant cameras see: about the same outline, colors and tags.
    """

    mesh: Mesh
    coarse: Mesh

    @classmethod
    def merge(cls, parts: Sequence["GradedMesh"]) -> Self:
        """Merge several parts into one object."""
        return cls(Mesh.merge([part.mesh for part in parts]), Mesh.merge([part.coarse for part in parts]))
