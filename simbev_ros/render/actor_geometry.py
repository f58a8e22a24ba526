"""The actors on the GPU: one vertex array per model, drawn instanced. Poses come from the table of rigid parts."""

from collections.abc import Mapping, Sequence

import moderngl
import numpy as np

from simbev_ros.assets.actor_model import ActorModel
from simbev_ros.render.hidden import Occluders
from simbev_ros.render.proxy import coarse_mesh
from simbev_ros.render.rigid_table import RigidTable
from simbev_ros.render.vertices import upload_mesh
from simbev_ros.render.view import View
from simbev_ros.scene.state import WorldState
from simbev_ros.types import BoolArray, Float64Array, UInt8Array

_MAX_INSTANCES = 4096
_COARSE_CELL_M = 0.3


class ActorGeometry:
    """All models of the catalogue."""

    def __init__(
        self,
        context: moderngl.Context,
        models: Sequence[ActorModel],
        programs: Mapping[str, moderngl.Program],
        shading_class: UInt8Array,
    ) -> None:
        """Upload the models for use with ``programs``; for those whose name starts with "coarse", coarse meshes."""
        fine = {name: program for name, program in programs.items() if not name.startswith("coarse")}
        coarse = {name: program for name, program in programs.items() if name.startswith("coarse")}
        self._instances = [context.buffer(reserve=4 * _MAX_INSTANCES) for _ in models]
        self._arrays = [
            upload_mesh(context, model.mesh, fine, shading_class, instances)
            | upload_mesh(context, coarse_mesh(model.mesh, _COARSE_CELL_M), coarse, shading_class, instances)
            for model, instances in zip(models, self._instances, strict=True)
        ]

    def draw(
        self,
        program: str,
        world: WorldState,
        table: RigidTable,
        chosen: BoolArray,
        **matrices: Float64Array,
    ) -> None:
        """Draw the (N,) chosen actors of the world, with (4, 4) ``matrices`` as the program's uniforms."""
        blueprints = world.actors["blueprint"]
        for blueprint in np.unique(blueprints[chosen]):
            rows = table.first_row[chosen & (blueprints == blueprint)].astype(np.uint32)
            self._instances[blueprint].write(rows.tobytes())
            array = self._arrays[blueprint][program]
            for name, matrix in matrices.items():
                array.program[name].write(matrix.T.astype(np.float32).tobytes())
            array.render(instances=len(rows))


def visible_actors(world: WorldState, table: RigidTable, view: View, occluders: Occluders, show_ego: bool) -> BoolArray:
    """(N,) which actors of the world a view may show."""
    seen = view.sees_spheres(table.center_m, table.radius_m)
    if not show_ego:
        seen &= ~np.isin(world.actors["id"], list(world.ego_ids))
    center_m, radius_m = table.center_m[seen], table.radius_m[seen, None]
    seen[seen] = ~occluders.hide(view, center_m - radius_m, center_m + radius_m)
    return seen
