"""The actors on the GPU: all models, each in several levels of detail, in one store.

An actor's level follows from the world and the view alone. Poses come from the table of rigid parts.
"""

from collections.abc import Mapping, Sequence

import moderngl
import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.render.geometry.level_of_detail import LevelsOfDetail
from simbev_ros.render.geometry.occlusion import Look
from simbev_ros.render.geometry.rigid_table import RigidTable
from simbev_ros.render.geometry.triangle_store import TriangleStore
from simbev_ros.render.view import View
from simbev_ros.scene.state import WorldState
from simbev_ros.types import BoolArray, Float64Array

_INSTANCE_DTYPE = np.dtype([("in_row", "<u4"), ("in_first", "<u4")])


class ActorGeometry:
    """All models of the catalogue."""

    def __init__(
        self,
        context: moderngl.Context,
        models: Sequence[ActorModel],
        programs: Mapping[str, moderngl.Program],
    ) -> None:
        """Upload the models for use with ``programs``."""
        self._detail = LevelsOfDetail(models)
        meshes = self._detail.meshes
        self.store = TriangleStore(context, [mesh for levels in meshes for mesh in levels], programs, _INSTANCE_DTYPE)
        self._counts = np.zeros((len(models), max(map(len, meshes), default=1)), np.int64)
        for row, levels in zip(self._counts, meshes, strict=True):
            row[: len(levels)] = [len(mesh.triangles) for mesh in levels]
        self._ends = np.cumsum(self._counts).reshape(self._counts.shape)

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
        for name, matrix in matrices.items():
            self.store.program(program)[name].write(matrix.T.astype(np.float32).tobytes())  # type: ignore[union-attr]
        kinds = np.stack([world.actors["blueprint"], self._detail.of(world.actors, pixel_m)], axis=1)[chosen]
        alike, counts = np.unique(kinds, axis=0, return_counts=True)
        instances = np.empty(len(kinds), _INSTANCE_DTYPE)
        instances["in_row"] = table.first_row[chosen][np.lexsort(kinds.T[::-1])]
        ends = self._ends[*alike.T]
        self.store.draw(program, ends - self._counts[*alike.T], ends, counts, instances)


def visible_actors(world: WorldState, table: RigidTable, view: View, look: Look | None, show_ego: bool) -> BoolArray:
    """(N,) which actors of the world a view may show, without what ``look`` finds hidden."""
    seen = view.sees_spheres(table.center_m, table.radius_m)
    if not show_ego:
        seen &= ~np.isin(world.actors["id"], list(world.ego_ids))
    if look and seen.any():
        center_m, radius_m = table.center_m[seen], table.radius_m[seen, None]
        seen[seen] = ~look().hide(view, center_m - radius_m, center_m + radius_m)
    return seen
