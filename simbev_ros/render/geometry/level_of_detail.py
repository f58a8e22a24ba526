"""How finely a camera draws each actor. Labels ask here too, so that they see an actor as the camera did. No OpenGL."""

from collections.abc import Sequence

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.types import Float64Array, Int64Array, Table

_ERROR_PX = 0.5
"""How far coarser meshes may be from the exact one."""

_LIMB_REACH_M = 0.6


class LevelsOfDetail:
    """The meshes of all models, from exact to coarse.

    Attributes:
        meshes: By blueprint and level.
    """

    def __init__(self, models: Sequence[ActorModel]) -> None:
        """For models, indexed by blueprint."""
        coarser = [model.build_coarser() for model in models]
        self.meshes: list[list[Mesh]] = [
            [model.mesh, *(level.mesh for level in more)] for model, more in zip(models, coarser, strict=True)
        ]
        self._errors_m = np.full((len(models), max(map(len, self.meshes), default=1)), np.inf)
        for row, more in zip(self._errors_m, coarser, strict=True):
            row[: 1 + len(more)] = [0.0, *(level.error_m for level in more)]

    def of(self, actors: Table, pixel_m: Float64Array) -> Int64Array:
        """(N,) the coarsest level that each of (N,) ``ACTOR_DTYPE`` actors may be drawn in.

        Args:
            actors: Rows of the world's table.
            pixel_m: (N,) the size of a pixel where they are (``View.pixel_m``).
        """
        fits = self._errors_m[actors["blueprint"]] <= _ERROR_PX * pixel_m[:, None]
        fits[actors["doors"] != 0, 1:] = False
        level: Int64Array = fits.sum(axis=1) - 1
        return level


def bounding_spheres(actors: Table, origin_m: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Spheres around (N,) ``ACTOR_DTYPE`` actors; limbs swing out of an actor's box, but not out of its sphere.

    Returns:
        (N, 3) their middles in metres, map axes, relative to (3,) ``origin_m``; (N,) their radii.
    """
    size_m = np.stack([actors["length"], actors["width"], actors["height"]], axis=1).astype(np.float64)
    foot_m = np.stack([actors["x"], actors["y"], actors["z"]], axis=1) - origin_m
    return foot_m + size_m * [0.0, 0.0, 0.5], np.linalg.norm(size_m, axis=1) / 2.0 + _LIMB_REACH_M
