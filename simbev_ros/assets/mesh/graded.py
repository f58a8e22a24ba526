"""Things in two grades: exact, and with fewer triangles for cameras far away."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from simbev_ros.assets.mesh.mesh import Mesh


@dataclass(frozen=True, slots=True, eq=False)
class GradedMesh:
    """A thing and its stand-in.

    Attributes:
        mesh: What is seen from nearby, hit by rays and labeled.
        coarse: What cameras see from afar: of about the same outline, colors and tags.
    """

    mesh: Mesh
    coarse: Mesh

    @classmethod
    def merge(cls, parts: Sequence["GradedMesh"]) -> Self:
        """One thing of several parts."""
        return cls(Mesh.merge([part.mesh for part in parts]), Mesh.merge([part.coarse for part in parts]))
