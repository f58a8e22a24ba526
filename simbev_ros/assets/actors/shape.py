"""Shapes of actors as data (shapes/<blueprint>.yaml), and the models that are built from them."""

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel, CoarserMesh, Part
from simbev_ros.assets.actors.clothing import figure_solids
from simbev_ros.assets.actors.detail import COARSER, COARSER_FIGURES, EXACT, Detail
from simbev_ros.assets.actors.doors import Door, door_parts, seats
from simbev_ros.assets.actors.figure import Figure, body_part, figure_cycle, figure_parts, figure_pose
from simbev_ros.assets.actors.lofting import build_shell
from simbev_ros.assets.actors.shell import Shell
from simbev_ros.assets.actors.skeletons import part_poses
from simbev_ros.assets.actors.solids import AnySolid, Solid, Vector, build_solid
from simbev_ros.assets.actors.variants import Reshape, load_variants, reshape_shape
from simbev_ros.assets.actors.wardrobe import composed_figure
from simbev_ros.assets.actors.wheels import Wheels, build_wheels, wheel_parts
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.config.base import Model
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.blueprints import Blueprint
from simbev_ros.scene.gait import load_gaits, transition_mps
from simbev_ros.schema.scene.state import ACTOR_DTYPE

_MAX_STRETCH = 0.03
_PHASES = 48  # steps of a stride at which its extent is evaluated
_VERTEX_COLUMNS = ("vertices", "normals", "uv", "color", "material", "tag", "part")


class ShapePart(Model):
    """Further rigid part, for example a fork or cranks; a parent comes before its children.

    Attributes:
        name: Name that solids refer to.
        parent: The part that it moves with.
        pivot: Point that it turns about.
        spins: Whether it turns with the wheels.
        steers: Whether it turns with the steering angle.
        cranks: Whether it turns with the pedals.
    """

    name: str
    parent: str = "body"
    pivot: Vector
    spins: bool = False
    steers: bool = False
    cranks: bool = False


class Shape(Model):
    """Shape of an actor, as a shape file describes it.

    Attributes:
        shells: Smooth vehicle bodies.
        wheels: Wheels with tires, for vehicles with two sides.
        doors: Pairs of doors, front to rear.
        parts: Rigid parts besides the body, the wheels and the doors; parents come first.
        figure: Human figure, for pedestrians and riders.
        solids: Everything else: mirrors, plates, bars, lamps.
    """

    shells: tuple[Shell, ...] = ()
    wheels: Wheels | None = None
    doors: tuple[Door, ...] = ()
    parts: tuple[ShapePart, ...] = ()
    figure: Figure | None = None
    solids: tuple[AnySolid, ...] = ()


def load_shape(blueprint: str) -> Shape:
    """Load the shape of a blueprint from its file or its entry in variants.yaml, or compose it from the wardrobe.

    A shape may extend another one: then the base is changed as its ``reshape`` says, its solids are added, the k-th
    list of its ``patches`` is added to the k-th shell, and its fields of the figure override those of the base.
    """
    figure = composed_figure(blueprint)
    return Shape.model_validate(_read(blueprint) if figure is None else {"figure": figure})


def _read(blueprint: str) -> dict[str, Any]:
    """Content of a shape's file, merged with the files that it extends."""
    variant = load_variants()["shapes"].get(blueprint)
    data: dict[str, Any] = (
        deepcopy(variant) if variant else load_table("simbev_ros.assets.actors", f"shapes/{blueprint}.yaml")
    )
    if "extends" not in data:
        return data
    base = _read(data.pop("extends"))
    if "reshape" in data:
        base = reshape_shape(base, Reshape.model_validate(data.pop("reshape")))
    for shell, patches in zip(base.get("shells", ()), data.pop("patches", ()), strict=False):
        shell["patches"] = [*shell.get("patches", ()), *patches]
    solids = base.get("solids", []) + data.pop("solids", [])
    figure = (base.get("figure") or {}) | data.pop("figure", {})
    return base | {"solids": solids, "figure": figure or None} | data


def build_model(blueprint: Blueprint, shape: Shape) -> ActorModel:
    """Build the model of a blueprint from its shape, scaled to exactly the blueprint's size.

    Raises:
        ValueError: The shape is more than 3 % larger or smaller than the blueprint along an axis.
    """
    pose = figure_pose(shape.figure, blueprint.tall_m) if shape.figure else None
    parts = [body_part(pose) if pose else Part("body")]
    parts += [*(wheel_parts(shape.wheels) if shape.wheels else []), *door_parts(shape.doors)]
    solids: list[Solid] = [*shape.solids]
    if shape.figure and pose:
        parts += figure_parts(shape.figure, pose, first=len(parts))
        solids += figure_solids(shape.figure, pose)
    for entry in shape.parts:
        parts.append(_part(entry, [part.name for part in parts]))
    index = {part.name: index_in_parts for index_in_parts, part in enumerate(parts)}
    build = partial(_build, shape, tuple(solids), blueprint.tag, index)
    model = ActorModel(
        blueprint=blueprint.name,
        tag=blueprint.tag,
        box_class=blueprint.box_class,
        mesh=build(EXACT),
        size_m=blueprint.size_m,
        parts=tuple(parts),
        wheel_radius_m=blueprint.wheel_radius_m,
        cycle=figure_cycle(pose, list(index)) if pose and len(pose.speed_mps) else None,
    )
    bounds_m = model.mesh.bounds_m
    if model.cycle and blueprint.on_foot:
        max_walk_mps = min(transition_mps(blueprint.tall_m), blueprint.max_speed_mps or np.inf)
        bounds_m = stride_bounds(model, max_walk_mps if blueprint.runs_as else model.cycle.speed_mps[-1])
    fitted = _fit(blueprint, bounds_m)
    return replace(
        model,
        mesh=model.mesh.transform(fitted),
        parts=tuple(replace(part, pivot_m=_transform_point(fitted, part.pivot_m)) for part in parts),
        build_coarser=partial(_coarser, build, fitted, COARSER_FIGURES if shape.figure else COARSER),
    )


def _build(shape: Shape, solids: tuple[Solid, ...], tag: Tag, part_index: dict[str, int], detail: Detail) -> Mesh:
    """Mesh of a shape in a level of detail, before it is scaled to its blueprint."""
    meshes = [mesh for shell in shape.shells for mesh in build_shell(shell, tag, part_index, detail)]
    if shape.wheels:
        meshes += build_wheels(shape.wheels, tag, 1, detail)
    spinning = {part.name for part in shape.parts if part.spins}
    for solid in (*solids, *(seats(shape.doors) if detail.insides else ())):
        meshes += build_solid(solid, tag, part_index, detail.for_spinning_parts if solid.part in spinning else detail)
    return _by_part(Mesh.merge(meshes))


def _coarser(
    build: Callable[[Detail], Mesh], fitted: Float64Array, details: Sequence[Detail]
) -> tuple[CoarserMesh, ...]:
    """Coarser meshes of a model, see ``ActorModel.build_coarser``."""
    return tuple(CoarserMesh(build(detail).transform(fitted), detail.error_m) for detail in details)


def stride_bounds(model: ActorModel, top_mps: float) -> Float64Array:
    """(2, 3) bounds of a pedestrian over the strides of all speeds in gait.yaml up to a maximum."""
    assert model.cycle is not None
    speeds_mps = model.cycle.speed_mps[:: (len(model.cycle.speed_mps) - 1) // (len(load_gaits()) - 1)]
    speed_mps, gait_rad = np.meshgrid(
        speeds_mps[speeds_mps < top_mps + 1e-6], np.linspace(0.0, 2.0 * np.pi, _PHASES, endpoint=False)
    )
    actors = np.zeros(speed_mps.size, ACTOR_DTYPE)
    actors["vx"], actors["gait"] = speed_mps.ravel(), gait_rad.ravel()
    poses = part_poses(model, actors)
    bounds = []
    for part in np.unique(model.mesh.part):
        vertices = model.mesh.vertices[model.mesh.part == part]
        posed = vertices @ poses[:, part, :3, :3].swapaxes(1, 2) + poses[:, part, None, :3, 3]
        bounds.append([posed.min(axis=(0, 1)), posed.max(axis=(0, 1))])
    extremes = np.array(bounds)
    low_m, high_m = extremes[:, 0].min(axis=0), extremes[:, 1].max(axis=0)
    low_m[2] = model.mesh.bounds_m[0, 2]  # running feet sink in by a millimeter
    return np.stack([low_m, high_m])


def _by_part(mesh: Mesh) -> Mesh:
    """Copy of a mesh with vertices and triangles sorted by part."""
    order = np.argsort(mesh.part, kind="stable")
    index_in_parts = np.argsort(order).astype(np.int32)
    triangles = mesh.triangles[np.argsort(mesh.part[mesh.triangles[:, 0]], kind="stable")]
    columns = {name: getattr(mesh, name)[order] for name in _VERTEX_COLUMNS}
    return Mesh(**columns, triangles=index_in_parts[triangles])


def _part(entry: ShapePart, names: list[str]) -> Part:
    """Rigid part from its entry in a shape file."""
    return Part(
        name=entry.name,
        parent=names.index(entry.parent),
        pivot_m=entry.pivot,
        spins=entry.spins,
        steers=entry.steers,
        cranks=entry.cranks,
    )


def _fit(blueprint: Blueprint, bounds_m: Float64Array) -> Float64Array:
    """(4, 4) scaling that makes a mesh with these bounds fill the blueprint's box and stand on its ground plane."""
    extent = bounds_m[1] - bounds_m[0]
    scale = np.array(blueprint.size_m) / extent
    if np.abs(scale - 1.0).max() > _MAX_STRETCH:
        raise ValueError(f"the shape of {blueprint.name} is {extent.round(3)} m, its blueprint says {blueprint.size_m}")
    foot = np.array([*bounds_m.mean(axis=0)[:2], bounds_m[0, 2]])
    fit = np.diag([*scale, 1.0])
    fit[:3, 3] = -scale * foot
    return fit


def _transform_point(transform: Float64Array, point_m: Vector) -> Vector:
    """Point transformed by a (4, 4) transform."""
    x, y, z = (transform[:3, :3] @ np.array(point_m) + transform[:3, 3]).tolist()
    return x, y, z
