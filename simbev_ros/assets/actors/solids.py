"""Simple solids that complete a shape (mirrors, tubes, limbs): their data models and meshes."""

from typing import Annotated, Any, Literal, Self

import numpy as np
import shapely
from pydantic import Field

from simbev_ros.assets.actors.detail import Detail
from simbev_ros.assets.actors.finishes import finish_named, mirrored_name
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box, ellipsoid, extrusion, lathe, loft, tube
from simbev_ros.config.base import Model
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array

Vector = tuple[float, float, float]

_LENGTHS = ("size", "bevel", "path", "radius", "rings", "profile", "polygon", "width")
"""Fields of solids with lengths; where they are whole numbers, they are counts."""


class Solid(Model):
    """Base of all solids of a shape; meters and degrees, actor frame.

    Attributes:
        finish: Name of a finish in finishes.yaml, or a material with a color such as ``cloth #304050``. Finishes with
            the material of a lamp (``low_beam``, ``tail``, ``turn_left``, ``reverse``, ``beacon``) shine with the
            actor's light bits; ``paint`` and ``clothes`` are multiplied by the actor's color, ``second``, ``skin``,
            ``hair`` and ``shoes`` by those of a person's look.
        part: Name of the rigid part that moves the solid: ``body``, a wheel, a door, or one of ``parts``.
        at: Position of the solid's origin.
        turn: Roll, pitch, yaw about the origin.
        mirrored: Whether there is a mirror image; "left" in its names of finish and part becomes "right".
    """

    finish: str
    part: str = "body"
    at: Vector = (0.0, 0.0, 0.0)
    turn: Vector = (0.0, 0.0, 0.0)
    mirrored: bool = False

    @property
    def thickness_m(self) -> float:
        """Thickness that decides whether the solid is shown: its second largest extent, or more."""
        raise NotImplementedError

    def mesh(self, finish: Finish, detail: Detail) -> Mesh:
        """Build the solid's mesh about its own origin in a level of detail."""
        raise NotImplementedError

    def placed(self, scale: float, at_m: Float64Array, part: str) -> Self:
        """Copy of the solid, scaled about the frame's origin, which is then moved to (3,) ``at_m``, on another part."""
        lengths = {name: _scaled(getattr(self, name), scale) for name in _LENGTHS if name in type(self).model_fields}
        x, y, z = (scale * np.array(self.at) + at_m).tolist()
        return self.model_copy(update=lengths | {"at": (x, y, z), "part": part})


class Box(Solid):
    """A cuboid about its center."""

    shape: Literal["box"]
    size: Vector
    bevel: float = 0.0

    @property
    def thickness_m(self) -> float:
        """See ``Solid``."""
        return sorted(self.size)[1]

    def mesh(self, finish: Finish, detail: Detail) -> Mesh:
        """See ``Solid``."""
        return box(finish, self.size, bevel_m=self.bevel if detail.shows(self.bevel / 2.0) else 0.0)


class Ellipsoid(Solid):
    """An ellipsoid about its center; ``size`` is its three diameters."""

    shape: Literal["ellipsoid"]
    size: Vector
    segments: int = 10
    rings: int = 6

    @property
    def thickness_m(self) -> float:
        """See ``Solid``."""
        return sorted(self.size)[1]

    def mesh(self, finish: Finish, detail: Detail) -> Mesh:
        """See ``Solid``."""
        x, y, z = self.size
        segments = detail.segments(self.segments, max(x, y) / 2)
        rings = (detail.segments(2 * self.rings, z / 2, minimum=6) + 1) // 2
        return ellipsoid(finish, (x / 2, y / 2, z / 2), segments=segments, rings=rings)


class Tube(Solid):
    """A round bar along points [x, y, z], or [x, y, z, radius] where it tapers."""

    shape: Literal["tube"]
    path: tuple[tuple[float, ...], ...]
    radius: float = 0.01
    segments: int = 7

    @property
    def thickness_m(self) -> float:
        """Twice the actual thickness, because free-standing bars are missed sooner."""
        return 4.0 * max(point[3] if len(point) > 3 else self.radius for point in self.path)

    def mesh(self, finish: Finish, detail: Detail) -> Mesh:
        """See ``Solid``."""
        points = np.array([(*point[:3], point[3] if len(point) > 3 else self.radius) for point in self.path])
        points = points[detail.needed(points)]
        segments = detail.segments(self.segments, float(points[:, 3].max()))
        return tube(finish, points[:, :3], points[:, 3], segments=segments)


class Rings(Solid):
    """A body through horizontal oval rings [x, y, z, half x, half y], bottom to top; ``squareness`` 2 is an ellipse."""

    shape: Literal["rings"]
    rings: tuple[tuple[float, float, float, float, float], ...]
    squareness: float = 2.3
    segments: int = 10
    crease_deg: float = 60.0

    @property
    def thickness_m(self) -> float:
        """See ``Solid``."""
        return 2.0 * max(max(ring[3:]) for ring in self.rings)

    def mesh(self, finish: Finish, detail: Detail) -> Mesh:
        """See ``Solid``."""
        segments = detail.segments(self.segments, self.thickness_m / 2.0, minimum=5)
        angles = (np.arange(segments) + 0.5) * (2.0 * np.pi / segments)
        cosine, sine = np.cos(angles), np.sin(angles)
        exponent = 2.0 / self.squareness
        unit = np.stack(
            [np.sign(cosine) * np.abs(cosine) ** exponent, np.sign(sine) * np.abs(sine) ** exponent], axis=1
        )
        unit /= np.abs(unit).max(axis=0)
        rings = np.array(self.rings)
        rings = rings[detail.needed(rings)]
        sections = np.repeat(rings[:, None, :3], segments, axis=1)
        sections[..., :2] += unit * rings[:, None, 3:]
        return loft(finish, sections, crease_deg=self.crease_deg)


class Lathe(Solid):
    """A solid of revolution about y: points [radius, y] by ascending y; a ring if the last point equals the first."""

    shape: Literal["lathe"]
    profile: tuple[tuple[float, float], ...]
    segments: int = 12

    @property
    def thickness_m(self) -> float:
        """See ``Solid``."""
        return 2.0 * max(radius for radius, _ in self.profile)

    def mesh(self, finish: Finish, detail: Detail) -> Mesh:
        """See ``Solid``."""
        segments = detail.segments(self.segments, self.thickness_m / 2.0)
        upright = lathe(finish, np.array(self.profile), segments=segments, caps=self.profile[0] != self.profile[-1])
        return upright.transform(_pose((-90.0, 0.0, 0.0), (0.0, 0.0, 0.0)))


class Spokes(Solid):
    """Bars across a wheel about y, through its center."""

    shape: Literal["spokes"]
    radius: float
    count: int
    size: tuple[float, float]

    @property
    def thickness_m(self) -> float:
        """See ``Solid``."""
        return max(self.size)

    def mesh(self, finish: Finish, detail: Detail) -> Mesh:
        """See ``Solid``."""
        turns = [_pose((0.0, 180.0 / self.count * k, 0.0), (0.0, 0.0, 0.0)) for k in range(self.count)]
        return Mesh.merge([box(finish, (2.0 * self.radius, *self.size)).transform(turn) for turn in turns])


class Profile(Solid):
    """A polygon [x, z] of a side view, extruded to ``width`` along y."""

    shape: Literal["profile"]
    polygon: tuple[tuple[float, float], ...]
    width: float

    @property
    def thickness_m(self) -> float:
        """See ``Solid``."""
        x, z = np.ptp(self.polygon, axis=0)
        return sorted((float(x), float(z), self.width))[1]

    def mesh(self, finish: Finish, detail: Detail) -> Mesh:
        """See ``Solid``."""
        flat = extrusion(finish, shapely.Polygon(self.polygon), -self.width / 2.0, self.width / 2.0)
        return flat.transform(_pose((90.0, 0.0, 0.0), (0.0, 0.0, 0.0)))


AnySolid = Annotated[Box | Ellipsoid | Tube | Rings | Lathe | Spokes | Profile, Field(discriminator="shape")]

_MIRROR = np.diag([1.0, -1.0, 1.0, 1.0])


def build_solid(solid: Solid, tag: Tag, part_index: dict[str, int], detail: Detail) -> list[Mesh]:
    """Build a solid at its position, and its mirror image if it has one; nothing if it is too thin to show."""
    if not detail.shows(solid.thickness_m):
        return []
    pose = _pose(solid.turn, solid.at)
    finish = finish_named(solid.finish, tag, part_index[solid.part])
    meshes = [solid.mesh(finish, detail).transform(pose)]
    if solid.mirrored:
        other = finish_named(mirrored_name(solid.finish), tag, part_index[mirrored_name(solid.part)])
        meshes.append(solid.mesh(other, detail).transform(_MIRROR @ pose))
    return meshes


def _scaled(value: Any, scale: float) -> Any:
    """Lengths, or tuples of lengths, times a scale; counts as they are."""
    if isinstance(value, tuple):
        return tuple(_scaled(each, scale) for each in value)
    return value if isinstance(value, int) else value * scale


def _pose(turn_deg: Vector, at_m: Vector) -> Float64Array:
    """(4, 4) transform that rotates by roll, pitch, yaw and then translates."""
    return matrices_from_xyz_rpy(np.array(at_m), np.radians(turn_deg))
