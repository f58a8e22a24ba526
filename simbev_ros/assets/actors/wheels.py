"""Wheels of cars, trucks and buses: their data model, rigid parts and meshes."""

from dataclasses import replace
from typing import Literal

import numpy as np

from simbev_ros.assets.actors.actor_model import Part
from simbev_ros.assets.actors.detail import Detail
from simbev_ros.assets.actors.finishes import finish_named
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box, lathe
from simbev_ros.config.base import Model
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag


class Wheels(Model):
    """Wheels of a vehicle or trailer with two sides.

    The parts are called ``wheel <axle> left`` and ``wheel <axle> right``, axles counted from 0.

    Attributes:
        radius: Radius of the tire, meters.
        width: Width of the tire, meters.
        axles: x of the axles, front to rear.
        half_track: y of the outer face of the tires.
        rim: Radius of the rim over that of the tire.
        spokes: Number of spokes; 0 for a plain steel disc.
        finish: Finish of the spokes or disc.
        twin: Whether all axles but the first have double tires.
        steers: Whether the first axle steers.
        first: Fields that the first axle has otherwise, such as the radius of a farm tractor's front wheels.
    """

    radius: float
    width: float
    axles: tuple[float, ...]
    half_track: float
    rim: float = 0.72
    spokes: int = 5
    finish: Literal["alloy", "steel", "dark_metal", "chrome"] = "alloy"
    twin: bool = False
    steers: bool = True
    first: dict[str, float] | None = None

    def of_axle(self, axle: int) -> "Wheels":
        """These wheels with the fields that an axle has, counted from 0."""
        return self if axle or not self.first else self.model_copy(update=self.first)


_SEGMENTS = 20
_SPOKE_M = 0.01
"""Thickness of the spokes' relief."""


def wheel_parts(wheels: Wheels) -> list[Part]:
    """Rigid parts of all wheels: axle by axle, left then right."""
    return [
        Part(
            name=f"wheel {axle} {'left' if side > 0 else 'right'}",
            parent=0,
            pivot_m=(x, side * (own.half_track - own.width / 2.0), own.radius),
            spins=wheels.radius / own.radius,
            steers=wheels.steers and axle == 0,
        )
        for axle, x in enumerate(wheels.axles)
        for own in (wheels.of_axle(axle),)
        for side in (1, -1)
    ]


def build_wheels(wheels: Wheels, tag: Tag, first_part: int, detail: Detail) -> list[Mesh]:
    """Build the meshes of all wheels; wheel k moves with part ``first_part + k``."""
    meshes = []
    detail = detail.for_spinning_parts
    first = _wheel(wheels.of_axle(0), tag, detail)
    single = twin = _wheel(wheels, tag, detail) if wheels.first else first
    if wheels.twin:
        inner = np.eye(4)
        inner[2, 3] = -1.15 * wheels.width
        twin = Mesh.merge([single, _tire(wheels, tag, detail).transform(inner)])
    for index, part in enumerate(wheel_parts(wheels)):
        x, y, z = part.pivot_m
        vehicle_from_wheel = matrices_from_xyz_rpy(
            np.array([x, y, z]), np.array([-np.copysign(np.pi / 2.0, y), 0.0, 0.0])
        )
        wheel = (twin if index >= 2 else first).transform(vehicle_from_wheel)
        meshes.append(replace(wheel, part=np.full_like(wheel.part, first_part + index)))
    return meshes


def _wheel(wheels: Wheels, tag: Tag, detail: Detail) -> Mesh:
    """A wheel about its center, its axle along z, its outer face up."""
    face = wheels.width / 2.0
    rim = wheels.radius * wheels.rim
    metal = finish_named(wheels.finish, tag)
    meshes = [_tire(wheels, tag, detail)]
    segments = detail.segments(_SEGMENTS, wheels.radius, minimum=6)
    if not (wheels.spokes and detail.shows(_SPOKE_M)):
        dished = [(rim, 0.3 * face), (rim, 0.8 * face), (0.75 * rim, 0.5 * face), (0.45 * rim, 0.9 * face)]
        plain = [(rim, 0.5 * face), (rim, 0.85 * face), (0.9 * rim, 0.7 * face)]
        disc = [*plain, (0.0, 0.66 * face)] if wheels.spokes else [*dished, (0.0, 0.95 * face)]
        return Mesh.merge([*meshes, lathe(metal, np.array(disc), segments=segments)])
    dark = finish_named("black", tag)
    meshes.append(lathe(dark, np.array([(rim, 0.5 * face), (0.0, 0.55 * face)]), segments=segments))
    meshes.append(_ring([(rim, 0.5 * face), (1.01 * rim, 0.93 * face), (0.9 * rim, 0.8 * face)], metal, segments))
    meshes.append(lathe(metal, np.array([(0.2 * rim, 0.5 * face), (0.15 * rim, 0.85 * face)]), segments=6))
    for angle in np.arange(wheels.spokes) * (2.0 * np.pi / wheels.spokes):
        spoke = box(metal, (0.86 * rim, 0.22 * rim, 0.26 * face), (0.52 * rim, 0.0, 0.62 * face))
        meshes.append(spoke.transform(matrices_from_xyz_rpy(np.zeros(3), np.array([0.0, 0.0, angle]))))
    return Mesh.merge(meshes)


def _tire(wheels: Wheels, tag: Tag, detail: Detail) -> Mesh:
    """A tire about its center."""
    face = wheels.width / 2.0
    rim, radius = wheels.radius * wheels.rim, wheels.radius
    rubber = finish_named("rubber", tag)
    profile = [
        (rim, -0.85 * face),
        (radius, -0.8 * face),
        (radius, 0.7 * face),
        (0.94 * radius, face),
        (rim, 0.9 * face),
    ]
    return _ring(profile, rubber, detail.segments(_SEGMENTS, radius, minimum=6))


def _ring(profile: list[tuple[float, float]], finish: Finish, segments: int) -> Mesh:
    """A closed ring from the profile (radius, z) of its cross-section."""
    return lathe(finish, np.array([*profile, profile[0]]), segments=segments, caps=False)
