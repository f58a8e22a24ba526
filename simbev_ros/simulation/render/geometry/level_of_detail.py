"""Selects the level of detail of each actor for a camera. Labels use it too, to match the image. No OpenGL."""

from collections.abc import Sequence

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.detail import COARSER
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.foundation.on_demand import OnDemand
from simbev_ros.foundation.types import Float64Array, Int64Array, Table

_ERROR_PX = 0.5
"""Maximum deviation of a coarser mesh from the exact one."""

_LIMB_REACH_M = 0.6


class LevelsOfDetail:
    """The meshes of all models, from exact to coarse; those of a model are loaded when it is first used.

    Attributes:
        meshes: Meshes by blueprint and level.
    """

    def __init__(self, models: Sequence[ActorModel]) -> None:
        """Prepare the levels of models, indexed by blueprint."""
        self._models = models
        self._errors_m = np.full((len(models), 1 + len(COARSER)), np.nan)
        self.meshes: Sequence[list[Mesh]] = OnDemand(len(models), self.load)
        if models:
            self.load(0)  # if the cache of meshes has to be written, then not in the middle of a scene

    def load(self, blueprint: int) -> list[Mesh]:
        """Load the meshes of a model for a caller who does not need them kept in ``meshes``."""
        coarser = self._models[blueprint].build_coarser()
        self._errors_m[blueprint] = np.inf
        self._errors_m[blueprint, : 1 + len(coarser)] = [0.0, *(level.error_m for level in coarser)]
        return [self._models[blueprint].mesh, *(level.mesh for level in coarser)]

    def select_levels(self, actors: Table, pixel_m: Float64Array) -> Int64Array:
        """(N,) the coarsest level that may be used for each of (N,) ``ACTOR_DTYPE`` actors.

        Args:
            actors: Rows of the world's actors table.
            pixel_m: (N,) size of a pixel at each actor (``View.pixel_m``).
        """
        for blueprint in np.unique(actors["blueprint"]).tolist():
            if np.isnan(self._errors_m[blueprint, 0]):
                self.meshes[blueprint]
        fits = self._errors_m[actors["blueprint"]] <= _ERROR_PX * pixel_m[:, None]
        fits[actors["doors"] != 0, 1:] = False
        return fits.sum(axis=1) - 1


def bounding_spheres(actors: Table, origin_m: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Spheres around (N,) ``ACTOR_DTYPE`` actors; limbs may leave an actor's box, but not its sphere.

    Returns:
        (N, 3) their centers in meters, map axes, relative to (3,) ``origin_m``; (N,) their radii.
    """
    size_m = np.stack([actors["length"], actors["width"], actors["height"]], axis=1).astype(np.float64)
    position_m = np.stack([actors["x"], actors["y"], actors["z"]], axis=1) - origin_m
    return position_m + size_m * [0.0, 0.0, 0.5], np.linalg.norm(size_m, axis=1) / 2.0 + _LIMB_REACH_M
