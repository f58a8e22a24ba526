"""The table of rigid parts: current and previous pose of every part of every actor, for shaders to look up.

A ``WorldState`` enters, textures leave. Row 0 stands for everything static. The parts of one actor are contiguous, in
the order of its model.
"""

from dataclasses import dataclass

import moderngl
import numpy as np

from simbev_ros.assets.actors.skeletons import Skeletons
from simbev_ros.foundation.errors import RenderError
from simbev_ros.foundation.geometry.transforms import inverse
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float32Array, Float64Array, Int64Array, Table, UInt32Array
from simbev_ros.scene.interpolation import earlier_rows
from simbev_ros.scene.looks import looks_of
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.simulation.render.geometry.level_of_detail import bounding_spheres
from simbev_ros.simulation.render.gl.programs import TEXTURE_UNITS

_ROWS_PER_LINE = 128
_TEXELS_PER_ROW = 6
_MAX_ROWS = 1 << 16
_SIZE_UNITS_M = {"length": 0.1, "width": 0.02, "height": 0.02}


@dataclass(frozen=True, slots=True)
class RigidTable:
    """Rows of all rigid parts of the actors of a world.

    Attributes:
        poses: (R, 6, 4) float32: three rows of world-from-rest, three of previous-world-from-current-world.
        actors: (R, 4) uint32: actor id, light bits | behavior << 16, color red | green << 8 | blue << 16, and for
            vehicles with a cabin length / 0.1 m | width / 0.02 m << 8 | height / 0.02 m << 16 | tag << 24.
        tints: (R, 4) uint32: colors of skin, hair, second garment and leather, red | green << 8 | blue << 16.
        first_row: (N,) row of each actor's part 0, in the order of the actors table.
        center_m: (N, 3) world, center of a sphere around each actor.
        radius_m: (N,) its radius.
    """

    poses: Float32Array
    actors: UInt32Array
    tints: UInt32Array
    first_row: Int64Array
    center_m: Float64Array
    radius_m: Float64Array

    @classmethod
    def from_world(
        cls, skeletons: Skeletons, world: WorldState, previous: WorldState | None, origin_m: Float64Array
    ) -> "RigidTable":
        """Build the table of a world with its origin at (3,) ``origin_m`` in the map frame.

        Raises:
            RenderError: The world has more than 65,535 rigid parts, or an id that does not fit instance images.
        """
        actors = world.actors
        actor, _ = skeletons.rows(actors)
        rows = 1 + len(actor)
        if rows > _MAX_ROWS or (len(actors) and actors["id"].max() >= _MAX_ROWS):
            raise RenderError(f"{rows} rigid parts, largest actor id {actors['id'].max()}: both must be below 65536")
        previous_actors = None if previous is None else earlier_rows(actors, previous.actors)
        center_m, radius_m = bounding_spheres(actors, origin_m)
        of_row = np.concatenate([[0], 1 + actor])
        return cls(
            poses=_poses(skeletons, actors, previous_actors, origin_m),
            actors=_appearance(actors)[of_row],
            tints=_tints(actors)[of_row],
            first_row=1 + np.searchsorted(actor, np.arange(len(actors))),
            center_m=center_m,
            radius_m=radius_m,
        )


class RigidTextures:
    """A table on the GPU, bound to its texture units."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._poses: moderngl.Texture | None = None
        self._actors: moderngl.Texture | None = None

    def upload(self, table: RigidTable) -> None:
        """Replace the content; the textures grow when needed."""
        lines = -(-len(table.poses) // _ROWS_PER_LINE)
        if self._poses is None or self._actors is None or self._poses.height < lines:
            self._poses, self._actors = self._allocate(lines)
        padding = lines * _ROWS_PER_LINE - len(table.poses)
        width = _ROWS_PER_LINE * _TEXELS_PER_ROW
        self._poses.write(np.pad(table.poses, ((0, padding), (0, 0), (0, 0))).tobytes(), (0, 0, width, lines))
        for half, columns in enumerate((table.actors, table.tints)):
            viewport = (half * _ROWS_PER_LINE, 0, _ROWS_PER_LINE, lines)
            self._actors.write(np.pad(columns, ((0, padding), (0, 0))).tobytes(), viewport)
        self.bind()

    def bind(self) -> None:
        """Bind the uploaded textures, if others have been bound since."""
        assert self._poses is not None and self._actors is not None
        self._poses.use(TEXTURE_UNITS["rigid_poses"])
        self._actors.use(TEXTURE_UNITS["rigid_actors"])

    def _allocate(self, lines: int) -> tuple[moderngl.Texture, moderngl.Texture]:
        for texture in (self._poses, self._actors):
            if texture is not None:
                texture.release()
        poses = self._context.texture((_ROWS_PER_LINE * _TEXELS_PER_ROW, lines), 4, dtype="f4")
        actors = self._context.texture((2 * _ROWS_PER_LINE, lines), 4, dtype="u4")
        poses.filter = actors.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return poses, actors


def _poses(skeletons: Skeletons, actors: Table, previous_actors: Table | None, origin_m: Float64Array) -> Float32Array:
    """(R, 6, 4) ``RigidTable.poses`` of the current and, if given, the previous actors."""
    world_from_part = _world_from_rest(skeletons, actors, origin_m)
    poses = np.tile(np.eye(4, dtype=np.float32)[[0, 1, 2, 0, 1, 2]], (1 + len(world_from_part), 1, 1))
    poses[1:, :3] = world_from_part[:, :3]
    if previous_actors is not None:
        poses[1:, 3:] = (_world_from_rest(skeletons, previous_actors, origin_m) @ inverse(world_from_part))[:, :3]
    return poses


def _world_from_rest(skeletons: Skeletons, actors: Table, origin_m: Float64Array) -> Float64Array:
    """(R - 1, 4, 4) poses of all parts."""
    world_from_actor = map_from_actors(actors)
    world_from_actor[:, :3, 3] -= origin_m
    return world_from_actor[skeletons.rows(actors)[0]] @ skeletons.poses(actors)


def _appearance(actors: Table) -> UInt32Array:
    """(1 + N, 4) ``RigidTable.actors`` of the static world, and of each actor."""
    appearance = np.zeros((1 + len(actors), 4), np.uint32)
    appearance[1:, 0] = actors["id"]
    appearance[1:, 1] = actors["lights"] | actors["behavior"].astype(np.uint32) << 16
    appearance[1:, 2] = _swapped(actors["color"])
    has_cabin = np.isin(actors["tag"], [Tag.CAR, Tag.TRUCK, Tag.BUS])
    size = np.stack([actors[name] / unit_m for name, unit_m in _SIZE_UNITS_M.items()], axis=1).round().astype(np.uint32)
    length, width, height = np.minimum(size, 255).T
    appearance[1:, 3] = has_cabin * (length | width << 8 | height << 16 | actors["tag"].astype(np.uint32) << 24)
    return appearance


def _tints(actors: Table) -> UInt32Array:
    """(1 + N, 4) ``RigidTable.tints`` of the static world, and of each actor."""
    return np.concatenate([np.zeros((1, 4), np.uint32), _swapped(looks_of(actors))])


def _swapped(color: UInt32Array) -> UInt32Array:
    """Colors 0xRRGGBB as red | green << 8 | blue << 16."""
    return np.asarray(color >> 16 & 0xFF | color & 0xFF00 | (color & 0xFF) << 16, np.uint32)
