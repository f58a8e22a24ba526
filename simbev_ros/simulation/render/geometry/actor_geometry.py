"""Actors on the GPU: the models in use, each in several levels of detail, in one triangle store.

An actor's level depends only on the world and the view. Poses come from the table of rigid parts.
"""

from collections.abc import Mapping, Sequence
from itertools import chain

import moderngl
import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.detail import COARSER
from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.render.geometry.level_of_detail import LevelsOfDetail
from simbev_ros.simulation.render.geometry.occlusion import ReadOccluders
from simbev_ros.simulation.render.geometry.rigid_table import RigidTable
from simbev_ros.simulation.render.geometry.triangle_store import TriangleStore
from simbev_ros.simulation.render.view import View

_ROOM = 1.5
"""Size of the buffers by that of the models which a world shows; more models come with the traffic."""
_INSTANCE_DTYPE = np.dtype([("in_row", "<u4"), ("in_first", "<u4")])


class ActorGeometry:
    """Uploaded meshes of the models that a world shows, and the draw calls for selected actors."""

    def __init__(
        self,
        context: moderngl.Context,
        models: Sequence[ActorModel],
        programs: Mapping[str, moderngl.Program],
    ) -> None:
        """Prepare the models for use with ``programs``."""
        self._detail = LevelsOfDetail(models)
        self.store = TriangleStore(context, (), programs, _INSTANCE_DTYPE)
        self._counts = np.zeros((len(models), 1 + len(COARSER)), np.int64)
        self._ends = self._counts.copy()
        self._held: frozenset[int] = frozenset()

    def hold(self, world: WorldState) -> None:
        """Upload the models of a world's actors unless they are held; without room for more, all others are dropped."""
        needed = frozenset(world.actors["blueprint"].tolist())
        if needed <= self._held:
            return
        added = sorted(needed - self._held)
        first, levels = self.store.triangles, [self._detail.load(blueprint) for blueprint in added]
        if self._held and self.store.add([*chain.from_iterable(levels)]):
            self._held |= needed
        else:
            self._held, added = needed, sorted(needed)
            first, levels = 0, [self._detail.load(blueprint) for blueprint in added]
            self.store.replace([*chain.from_iterable(levels)], _ROOM)
        self._counts[added] = 0
        for blueprint, meshes in zip(added, levels, strict=True):
            self._counts[blueprint, : len(meshes)] = [len(mesh.triangles) for mesh in meshes]
        self._ends[added] = first + np.cumsum(self._counts[added]).reshape(len(added), -1)

    def draw(
        self,
        program: str,
        world: WorldState,
        table: RigidTable,
        selected: BoolArray,
        pixel_m: Float64Array,
        **matrices: Float64Array,
    ) -> None:
        """Draw the selected actors of a world.

        Args:
            program: Name of the program.
            world: The world state.
            table: The table of its rigid parts.
            selected: (N,) which of its actors to draw.
            pixel_m: (N,) size of a pixel at each actor.
            matrices: (4, 4) uniforms of the program.
        """
        for name, matrix in matrices.items():
            self.store.program(program)[name].write(matrix.T.astype(np.float32).tobytes())  # type: ignore[union-attr]
        kinds = np.stack([world.actors["blueprint"], self._detail.select_levels(world.actors, pixel_m)], axis=1)[
            selected
        ]
        unique_kinds, counts = np.unique(kinds, axis=0, return_counts=True)
        instances = np.empty(len(kinds), _INSTANCE_DTYPE)
        instances["in_row"] = table.first_row[selected][np.lexsort(kinds.T[::-1])]
        ends = self._ends[*unique_kinds.T]
        self.store.draw(program, ends - self._counts[*unique_kinds.T], ends, counts, instances)


def visible_actors(
    world: WorldState, table: RigidTable, view: View, read_occluders: ReadOccluders | None, show_ego: bool
) -> BoolArray:
    """(N,) whether a view may show actors of the world; actors hidden by the occluders are left out."""
    visible = view.sees_spheres(table.center_m, table.radius_m)
    if not show_ego:
        visible &= ~np.isin(world.actors["id"], list(world.ego_ids))
    if read_occluders and visible.any():
        center_m, radius_m = table.center_m[visible], table.radius_m[visible, None]
        visible[visible] = ~read_occluders().hidden(view, center_m - radius_m, center_m + radius_m)
    return visible
