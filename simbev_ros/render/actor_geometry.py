"""The actors on the GPU: all models, each in several levels of detail, in one vertex array that is drawn in pieces.

An actor's level follows from the world and the view alone. Poses come from the table of rigid parts.
"""

from collections.abc import Mapping, Sequence

import moderngl
import numpy as np

from simbev_ros.assets.actor_model import ActorModel
from simbev_ros.assets.mesh import Mesh
from simbev_ros.render.hidden import Look
from simbev_ros.render.rigid_table import RigidTable
from simbev_ros.render.vertices import upload_mesh
from simbev_ros.render.view import View
from simbev_ros.scene.state import WorldState
from simbev_ros.types import BoolArray, Float64Array, Int64Array

_MAX_INSTANCES = 4096
_ERROR_PX = 0.5
"""How far coarser meshes may be from the exact one."""


class ActorGeometry:
    """All models of the catalogue."""

    def __init__(
        self,
        context: moderngl.Context,
        models: Sequence[ActorModel],
        programs: Mapping[str, moderngl.Program],
    ) -> None:
        """Upload the models for use with ``programs``."""
        coarser = [model.build_coarser() for model in models]
        meshes = [[model.mesh, *(level.mesh for level in more)] for model, more in zip(models, coarser, strict=True)]
        self._instances = context.buffer(reserve=4 * _MAX_INSTANCES)
        merged = Mesh.merged([mesh for levels in meshes for mesh in levels])
        self._arrays = upload_mesh(context, merged, programs, self._instances)
        counts = [[3 * len(mesh.triangles) for mesh in levels] for levels in meshes]
        ends = iter(np.cumsum([count for levels in counts for count in levels]).tolist())
        self._pieces = [[(next(ends) - count, count) for count in levels] for levels in counts]
        self._errors_m = np.full((len(models), max(map(len, meshes), default=1)), np.inf)
        for row, more in zip(self._errors_m, coarser, strict=True):
            row[: 1 + len(more)] = [0.0, *(level.error_m for level in more)]

    def draw(
        self,
        program: str,
        world: WorldState,
        table: RigidTable,
        chosen: BoolArray,
        pixel_m: Float64Array,
        **matrices: Float64Array,
    ) -> None:
        """Draw the chosen actors of the world.

        Args:
            program: Its name.
            world: The world.
            table: Its table.
            chosen: (N,) which of its actors.
            pixel_m: (N,) the size of a pixel where they are.
            matrices: The program's uniforms, (4, 4).
        """
        array = self._arrays[program]
        for name, matrix in matrices.items():
            array.program[name].write(matrix.T.astype(np.float32).tobytes())  # type: ignore[union-attr]
        blueprints, levels = world.actors["blueprint"][chosen], self._levels(world, pixel_m)[chosen]
        rows = table.first_row[chosen].astype(np.uint32)
        for blueprint, level in np.unique(np.stack([blueprints, levels], axis=1), axis=0).tolist():
            alike = rows[(blueprints == blueprint) & (levels == level)]
            first, count = self._pieces[blueprint][level]
            self._instances.write(alike.tobytes())
            array.render(vertices=count, first=first, instances=len(alike))

    def _levels(self, world: WorldState, pixel_m: Float64Array) -> Int64Array:
        """(N,) the coarsest level of each actor that may be drawn."""
        errors_m = self._errors_m[world.actors["blueprint"]]
        fits = errors_m <= _ERROR_PX * pixel_m[:, None]
        fits[world.actors["doors"] != 0, 1:] = False
        level: Int64Array = fits.sum(axis=1) - 1
        return level


def visible_actors(world: WorldState, table: RigidTable, view: View, look: Look | None, show_ego: bool) -> BoolArray:
    """(N,) which actors of the world a view may show, without what ``look`` finds hidden."""
    seen = view.sees_spheres(table.center_m, table.radius_m)
    if not show_ego:
        seen &= ~np.isin(world.actors["id"], list(world.ego_ids))
    if look and seen.any():
        center_m, radius_m = table.center_m[seen], table.radius_m[seen, None]
        seen[seen] = ~look().hide(view, center_m - radius_m, center_m + radius_m)
    return seen
