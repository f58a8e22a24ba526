"""A small world with known surfaces for rendering tests: ground, boxes, a ball, and a car with wheels."""

from dataclasses import replace

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel, Part
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, StreetLight, Tile
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.schema.scene.state import ACTOR_DTYPE, SIGNAL_DTYPE, WorldState
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.simulation.render.gl.context import describe_renderer

NOON = Weather(
    cloudiness=10,
    precipitation=0,
    precipitation_deposits=0,
    wetness=0,
    wind_intensity=0,
    sun_azimuth_deg=90,
    sun_altitude_deg=50,
    fog_density=0,
    fog_distance_m=0,
    fog_falloff=1,
)
CAMERA = PinholeCamera(160, 90, 110.0, 115.0, 71.3, 50.2)
"""Small, with an off-center principal point and unequal focal lengths."""


def box(
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    tag: Tag,
    material: Material = Material.PLAIN,
    part: int = 0,
) -> Mesh:
    """An axis-aligned box."""
    corners = np.array(
        [[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return Mesh.flat(corners[np.array(triangles)], material=material, tag=tag, color=(150, 140, 130), part=part)


def plane(half_m: float, z_m: float, tag: Tag, material: Material) -> Mesh:
    """A horizontal square that faces up."""
    a, b, c, d = ([-half_m, -half_m, z_m], [half_m, -half_m, z_m], [half_m, half_m, z_m], [-half_m, half_m, z_m])
    return Mesh.flat(np.array([[a, b, c], [a, c, d]]), material=material, tag=tag, color=(120, 120, 120))


def ball(center: tuple[float, float, float], radius_m: float, tag: Tag) -> Mesh:
    """A sphere of 16 x 8 facets, open at the poles."""
    longitude, latitude = np.meshgrid(np.linspace(0, 2 * np.pi, 17), np.linspace(-1.4, 1.4, 9), indexing="ij")
    grid = np.stack(
        [np.cos(longitude) * np.cos(latitude), np.sin(longitude) * np.cos(latitude), np.sin(latitude)], axis=-1
    )
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    corners = np.concatenate([np.stack([a, b, c], axis=-2), np.stack([a, c, d], axis=-2)]).reshape(-1, 3, 3)
    return Mesh.flat(corners * radius_m + center, material=Material.FOLIAGE, tag=tag, color=(60, 110, 40))


def scene(offset_m: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> StaticScene:
    """Ground, a house ahead on the left, a tree ahead on the right, with an offset in the map."""
    ground = plane(200.0, 0.0, Tag.ROAD, Material.ASPHALT)
    house = box((20, 4, 0), (30, 14, 8), Tag.BUILDING, Material.FACADE)
    tree = ball((18, -8, 3), 2.5, Tag.VEGETATION)
    origin = np.array(offset_m)
    tiles = (
        Tile(origin, Mesh.merge([ground, house]), {}),
        Tile(origin + np.array([10.0, 0.0, 0.0]), tree.transform(_shift(-10)), {}),
    )
    return StaticScene(tiles, (StreetLight((15.0 + offset_m[0], -5.0 + offset_m[1], 8.0 + offset_m[2])),))


BLUE = np.tile(np.array([[20, 40, 255]], np.uint8), (36, 1))
"""Colors of a box's vertices."""


def car() -> ActorModel:
    """A box on four square wheels, with headlamps, brake lamps and a beacon; the front wheels steer."""
    parts = [Part("body")]
    meshes = [
        *(box((2.1, y - 0.1, 0.6), (2.19, y + 0.1, 0.8), Tag.CAR, Material.LAMP_LOW_BEAM) for y in (-0.6, 0.6)),
        replace(box((-0.2, -0.2, 1.3), (0.2, 0.2, 1.49), Tag.CAR, Material.LAMP_EMERGENCY), color=BLUE),
        box((-2.2, -0.9, 0.4), (2.2, 0.9, 1.5), Tag.CAR, Material.CAR_PAINT),
        box((-2.25, -0.8, 0.8), (-2.2, 0.8, 1.1), Tag.CAR, Material.LAMP_TAIL),
    ]
    for x in (-1.4, 1.4):
        for y in (-0.85, 0.85):
            meshes.append(box((x - 0.3, y - 0.1, 0.0), (x + 0.3, y + 0.1, 0.6), Tag.CAR, Material.RUBBER, len(parts)))
            parts.append(Part("wheel", pivot_m=(x, y, 0.3), spins=True, steers=x > 0))
    return ActorModel("vehicle.test", Tag.CAR, "car", Mesh.merge(meshes), (4.45, 1.9, 1.5), tuple(parts), 0.3)


def actors(*rows: dict[str, float]) -> Table:
    """Actors table: the ego first (id 1), then one car per dictionary of fields."""
    table = np.zeros(len(rows), ACTOR_DTYPE)
    table["length"], table["width"], table["height"] = car().size_m
    table["tag"] = Tag.CAR
    for index, row in enumerate(rows):
        for name, value in row.items():
            table[name][index] = value
    return table


def world(*rows: dict[str, float], weather: Weather = NOON) -> WorldState:
    """A world with actors and no signals."""
    return WorldState(0, 0, 1, actors(*rows), np.zeros(0, SIGNAL_DTYPE), weather)


def front_pose() -> Float64Array:
    """Pose of a camera 1.6 m above the ego's origin, slightly yawed, pitched and rolled."""
    return matrices_from_xyz_rpy(np.array([0.5, 0.1, 1.6]), np.array([0.02, 0.05, 0.1]))


def vertex_snap_px() -> float:
    """Vertex grid of the renderer: GPUs snap vertices to 1/256 pixel, which shifts edges and tilts the ground."""
    return 0.0 if "llvmpipe" in describe_renderer() else 1.0 / 256.0


def snap_error_m(camera: PinholeCamera, depth_m: Float64Array) -> Float64Array:
    """Error of the depth of level ground, seen from ``front_pose``, that this tilt causes."""
    return np.asarray(depth_m) ** 2 * (vertex_snap_px() / (camera.fx_px * front_pose()[2, 3]))


def _shift(x_m: float) -> Float64Array:
    matrix = np.eye(4)
    matrix[0, 3] = x_m
    return matrix
