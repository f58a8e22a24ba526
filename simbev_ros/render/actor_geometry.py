"""The actors on the GPU: one vertex array per model, drawn instanced. Poses come from the table of rigid parts."""

from collections.abc import Mapping, Sequence

import moderngl
import numpy as np

from simbev_ros.assets.actor_model import ActorModel
from simbev_ros.render.hidden import Screen, box_corners
from simbev_ros.render.proxy import coarse_mesh
from simbev_ros.render.rigid_table import RigidTable
from simbev_ros.render.vertices import upload_mesh
from simbev_ros.render.view import View
from simbev_ros.scene.state import WorldState
from simbev_ros.types import BoolArray, Float64Array, UInt8Array

_MAX_INSTANCES = 4096
_LIMB_REACH_M = 0.6
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


def visible_actors(
    world: WorldState, view: View, origin_m: Float64Array, show_ego: bool, screen: Screen
) -> BoolArray:
    """(N,) which actors a view of the world at (3,) ``origin_m`` may show."""
    actors = world.actors
    center_m = np.stack([actors["x"], actors["y"], actors["z"] + actors["height"] / 2.0], axis=1) - origin_m
    size_m = np.stack([actors["length"], actors["width"], actors["height"]], axis=1).astype(np.float64)
    radius=np.linalg.norm(size_m, axis=1) / 2.0 + _LIMB_REACH_M
    seen = view.sees_spheres(center_m, radius)
    of_ego = (actors["id"] == world.ego_id) | (actors["parent"] == world.ego_id)
    if not show_ego: seen&=~of_ego
    half = np.stack([np.hypot(actors['length'],actors['width'])/2+.6]*2+[actors['height']/2+.6],1)
    i=np.flatnonzero(seen)
    seen[i]=~screen.hides(view.clip_from_world,box_corners((center_m-half)[i],(center_m+half)[i]))
    return seen
