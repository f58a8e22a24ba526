"""Batches objects that stand on the ground: they are collected first, then heights and copies are made in one step."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from simbev_ros.assets.mesh.graded import GradedMesh
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.placement.tiles import TileBuilder
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.types import Float64Array


class Base(Enum):
    """Surface that an object stands on."""

    LAND = "land"
    SIDEWALK = "sidewalk"
    ALONG_LAND = "along land"  # every vertex follows the land: for long objects


@dataclass(slots=True)
class _Copies:
    """Copies of one mesh on one base; rows are x, y, yaw, scale, red, green, blue."""

    mesh: Mesh | GradedMesh
    base: Base
    rows: list[Float64Array] = field(default_factory=list)


class Ensemble:
    """Collects objects by mesh; putting the same mesh object again adds copies of it."""

    def __init__(self) -> None:
        self._copies: dict[tuple[int, Base], _Copies] = {}

    def put(
        self,
        mesh: Mesh | GradedMesh,
        xy_m: Sequence[float] | Float64Array,
        yaw_rad: float | Float64Array = 0.0,
        *,
        base: Base = Base.LAND,
        scale: float | Float64Array = 1.0,
        tint: Float64Array | None = None,
    ) -> None:
        """Add an object, or (N,) copies of it.

        Args:
            mesh: Mesh of the object, with the origin at its foot, z up.
            xy_m: (2,) or (N, 2) positions, map frame.
            yaw_rad: Heading of the object's x axis.
            base: Surface that it stands on.
            scale: Factor of its size.
            tint: (3,) or (N, 3) factors of its colors.
        """
        xy_m = np.asarray(xy_m, np.float64).reshape(-1, 2)
        rows = np.empty((len(xy_m), 7))
        rows[:, :2], rows[:, 2], rows[:, 3] = xy_m, yaw_rad, scale
        rows[:, 4:7] = 1.0 if tint is None else tint
        if len(rows):
            self._copies.setdefault((id(mesh), base), _Copies(mesh, base)).rows.append(rows)

    def place_all(self, tiles: TileBuilder, ground: RegionGround) -> None:
        """Put all objects into the tiles, in the order in which their meshes were first added."""
        if not self._copies:
            return
        entries = list(self._copies.values())
        parts = [np.concatenate(entry.rows) for entry in entries]
        ends = np.cumsum([len(part) for part in parts])
        rows = np.concatenate(parts)
        base = np.repeat([list(Base).index(entry.base) for entry in entries], [len(part) for part in parts])
        z_m = np.zeros(len(rows))
        for number, height_m in ((0, ground.land_m), (1, ground.sidewalk_m)):
            chosen = base == number
            z_m[chosen] += height_m(rows[chosen, :2])
        poses = matrices_from_xyz_rpy(
            np.column_stack([rows[:, :2], z_m]), np.column_stack([np.zeros((len(rows), 2)), rows[:, 2]])
        )
        poses[:, :3, :3] *= rows[:, 3, None, None]
        for entry, part, pose in zip(entries, parts, np.split(poses, ends[:-1]), strict=True):
            tint = None if (part[:, 4:7] == 1.0).all() else part[:, 4:7]
            follow_m = ground.land_m if entry.base is Base.ALONG_LAND else None
            tiles.place_copies(entry.mesh, pose, tint, follow_m)
