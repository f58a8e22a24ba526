"""Things to be put on the ground, collected first and placed together: heights and copies are made in one step."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from simbev_ros.assets.mesh.graded import Graded
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.placement.tiles import TileBuilder
from simbev_ros.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.types import Float64Array


class Base(Enum):
    """What a thing stands on."""

    LAND = "land"
    SIDEWALK = "sidewalk"
    ALONG_LAND = "along land"  # every vertex follows the land: for what is long


@dataclass(slots=True)
class _Copies:
    """Of one mesh on one base: rows x, y, yaw, scale, red, green, blue, rise above the base."""

    mesh: Mesh | Graded
    base: Base
    rows: list[Float64Array] = field(default_factory=list)


class Ensemble:
    """Collects things by mesh. The same mesh object again is a copy."""

    def __init__(self) -> None:
        self._copies: dict[tuple[int, Base], _Copies] = {}

    def put(
        self,
        mesh: Mesh | Graded,
        xy_m: Sequence[float] | Float64Array,
        yaw_rad: float | Float64Array = 0.0,
        *,
        base: Base = Base.LAND,
        scale: float | Float64Array = 1.0,
        tint: Float64Array | None = None,
        rise_m: float | Float64Array = 0.0,
    ) -> None:
        """Add a thing, or (N,) copies of it.

        Args:
            mesh: Its frame has the origin at the foot, z up.
            xy_m: (2,) or (N, 2) places, map frame.
            yaw_rad: Of its x axis.
            base: What it stands on.
            scale: Of its size.
            tint: (3,) or (N, 3) factors of its colours.
            rise_m: So much above the base.
        """
        xy_m = np.asarray(xy_m, np.float64).reshape(-1, 2)
        rows = np.empty((len(xy_m), 8))
        rows[:, :2], rows[:, 2], rows[:, 3], rows[:, 7] = xy_m, yaw_rad, scale, rise_m
        rows[:, 4:7] = 1.0 if tint is None else tint
        if len(rows):
            self._copies.setdefault((id(mesh), base), _Copies(mesh, base)).rows.append(rows)

    def place_all(self, tiles: TileBuilder, ground: RegionGround) -> None:
        """Put everything into the tiles, in the order in which meshes were first added."""
        if not self._copies:
            return
        entries = list(self._copies.values())
        parts = [np.concatenate(entry.rows) for entry in entries]
        ends = np.cumsum([len(part) for part in parts])
        rows = np.concatenate(parts)
        base = np.repeat([list(Base).index(entry.base) for entry in entries], [len(part) for part in parts])
        z_m = rows[:, 7].copy()
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
