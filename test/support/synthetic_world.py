"""Worlds small enough to work out by hand: boxes, sheets and box-shaped actors."""

from collections.abc import Sequence

import numpy as np
from made_up_roads import clear_weather

from simbev_ros.assets.actors.actor_model import ActorModel, Part
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, Tile
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.schema.scene.state import ACTOR_DTYPE, SIGNAL_DTYPE, WorldState

TICK_NS = 50_000_000
EGO_ID = 7

_WEATHER = clear_weather(sun_altitude_deg=45.0)
_FACES = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])


def mesh(corners: Float64Array, tag: Tag, material: Material = Material.PLAIN, part: int = 0) -> Mesh:
    return Mesh.flat(corners, material=material, tag=tag, color=(128, 128, 128), part=part)


def sheet(low: Sequence[float], high: Sequence[float], z: float = 0.0) -> Float64Array:
    """(2, 3, 3) a level rectangle."""
    (x0, y0), (x1, y1) = low, high
    return np.array([[[x0, y0, z], [x1, y0, z], [x1, y1, z]], [[x0, y0, z], [x1, y1, z], [x0, y1, z]]])


def box(center: Sequence[float], size: Sequence[float]) -> Float64Array:
    """(12, 3, 3) a box, outward."""
    signs = np.array([[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
    quads = (signs * size + center)[_FACES]
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def ball(center: Sequence[float], radius: float) -> Float64Array:
    """(N, 3, 3) a sphere of facets of 5 degrees, outward."""
    up, around = np.meshgrid(np.radians(np.arange(-90, 91, 5)), np.radians(np.arange(0, 361, 5)), indexing="ij")
    level = np.cos(up)
    points = np.stack([level * np.cos(around), level * np.sin(around), np.sin(up)], axis=-1) * radius + center
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    return np.concatenate([np.stack(each, axis=-2).reshape(-1, 3, 3) for each in ((a, b, c), (a, c, d))])


def box_model(tag: Tag, size_m: tuple[float, float, float], material: Material = Material.CAR_PAINT) -> ActorModel:
    """An actor that fills its box."""
    return ActorModel(
        "box", tag, "", mesh(box([0, 0, size_m[2] / 2], size_m), tag, material), size_m, (Part("body"),), 0.0
    )


def cart_model() -> ActorModel:
    """A body above four square wheels that spin; the front ones, and nothing else, steer."""
    parts, meshes = [Part("body")], [mesh(box([0, 0, 1.1], [4.0, 1.6, 1.0]), Tag.CAR, Material.CAR_PAINT)]
    for x in (1.3, -1.3):
        for y in (0.9, -0.9):
            meshes.append(mesh(box([x, y, 0.4], [0.6, 0.2, 0.6]), Tag.CAR, Material.RUBBER, len(parts)))
            parts.append(Part("wheel", pivot_m=(x, y, 0.4), spins=True, steers=x > 0))
    return ActorModel("cart", Tag.CAR, "car", Mesh.merge(meshes), (4.0, 2.0, 1.6), tuple(parts), 0.3)


def static_scene(*meshes: Mesh, origin_m: Sequence[float] = (0.0, 0.0, 0.0), **surfaces: Mesh) -> StaticScene:
    """One tile."""
    return StaticScene((Tile(np.array(origin_m, np.float64), Mesh.merge(meshes), surfaces),), ())


def actor(model: ActorModel, blueprint: int = 0, **columns: float) -> Table:
    """(1,) actor row."""
    row = np.zeros(1, ACTOR_DTYPE)
    row["id"], row["blueprint"], row["tag"] = EGO_ID, blueprint, model.tag
    row["length"], row["width"], row["height"] = model.size_m
    for name, value in columns.items():
        row[name] = value
    return row


def world(*rows: Table, tick: int = 0) -> WorldState:
    """A state with the ego ``EGO_ID``."""
    actors = np.sort(np.concatenate(rows), order="id")
    return WorldState(tick * TICK_NS, tick, EGO_ID, actors, np.zeros(0, SIGNAL_DTYPE), _WEATHER)
