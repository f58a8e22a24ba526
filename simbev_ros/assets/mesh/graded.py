"""Things in two grades: exact, and with fewer triangles for cameras far away."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from simbev_ros.assets.mesh.mesh import Mesh


@dataclass(frozen=True, slots=True, eq=False)
class Graded:
    """A thing and its stand-in.

    Attributes:
        mesh: What is seen from nearby, hit by rays and labelled.
        coarse: What cameras see from afar: of about the same outline, colours and tags.
    """

    mesh: Mesh
    coarse: Mesh

    @classmethod
    def merged(cls, parts: Sequence["Graded"]) -> Self:
        """One thing of several parts."""
        return cls(Mesh.merged([part.mesh for part in parts]), Mesh.merged([part.coarse for part in parts]))
