"""A picture from the street: a place with something to see, and the renderer's view of it on a sunny day."""

from collections.abc import Sequence

import numpy as np

from simbev_ros.assets.catalogue import load_models
from simbev_ros.assets.static_scene import StaticScene, Tile
from simbev_ros.geometry.camera import PinholeCamera
from simbev_ros.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.render.frame import CameraView, RenderFrame
from simbev_ros.render.renderer import Renderer
from simbev_ros.scene.state import ACTOR_DTYPE, EGO_ID, SIGNAL_DTYPE, SignalState, WorldState
from simbev_ros.scene.weather import Weather
from simbev_ros.semantics import Tag
from simbev_ros.types import Float64Array, UInt8Array

_WIDTH_PX, _HEIGHT_PX = 1600, 900
_FIELD_OF_VIEW_RAD = np.radians(72.0)
_EYE_M = 1.9
_BEHIND_M = 6.0  # the car that every scene has stands so far behind the camera
_SPACING_M = 8.0
_MOST_PLACES = 400
_STRAIGHT_M = 45.0
_NEAR_M, _FAR_M = 7.0, 90.0
_CELL_M = 2.0
_SUN_BESIDE_DEG = 26.0  # the sun stands behind the camera, so far to the side


def street_place(network: RoadNetwork, tiles: Sequence[Tile], center_m: Float64Array) -> tuple[Float64Array, float]:
    """Where to stand: (3,) a place on a driving lane in the map frame, and the direction to look in, radians.

    The best of those around ``center_m`` that have a straight lane ahead and buildings and plants in view.
    """
    waypoints = network.waypoints(_SPACING_M)
    distance_m = np.linalg.norm(waypoints.position_m[:, :2] - center_m, axis=1)
    order = np.argsort(distance_m, kind="stable")[:_MOST_PLACES]
    position_m, yaw_rad = waypoints.position_m[order], waypoints.yaw_rad[order]
    lengths_m = np.array([network.lanes[waypoints.lane[k]].length_m for k in order])
    ahead_m = lengths_m - waypoints.s_m[order]
    buildings, plants = (_cells(tiles, tag) for tag in (Tag.BUILDING, Tag.VEGETATION))
    score = np.log1p(_in_view(position_m, yaw_rad, buildings)) + 0.4 * np.log1p(_in_view(position_m, yaw_rad, plants))
    score += 1.2 * np.clip(ahead_m / _STRAIGHT_M, 0.0, 1.0)
    best = int(np.argmax(score))
    return position_m[best], float(yaw_rad[best])


def street_view(network: RoadNetwork, static: StaticScene, place_m: Float64Array, yaw_rad: float) -> UInt8Array:
    """(900, 1600, 3) uint8 RGB of what a driver sees there, signals on green.

    Raises:
        RenderError: OpenGL is not usable here.
    """
    behind_m = place_m - _BEHIND_M * np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
    models = load_models()
    ego = np.zeros(1, ACTOR_DTYPE)
    ego["x"], ego["y"], ego["z"] = behind_m
    ego["yaw"], ego["id"], ego["tag"] = yaw_rad, EGO_ID, Tag.CAR
    ego["blueprint"] = next(k for k, model in enumerate(models) if model.tag == Tag.CAR)
    signals = np.zeros(len(network.signals), SIGNAL_DTYPE)
    signals["state"] = SignalState.GREEN
    world = WorldState(0, 0, EGO_ID, ego, signals, _fair_weather(yaw_rad))
    camera = PinholeCamera.from_field_of_view(_WIDTH_PX, _HEIGHT_PX, float(_FIELD_OF_VIEW_RAD))
    pose = matrices_from_xyz_rpy(np.array([_BEHIND_M, 0.0, _EYE_M]), np.zeros(3))
    renderer = Renderer(static, models)
    try:
        (images,) = renderer.render([CameraView(camera, pose, ("rgb",))], RenderFrame(world))
    finally:
        renderer.close()
    assert images.rgb is not None
    return images.rgb


def _fair_weather(yaw_rad: float) -> Weather:
    return Weather(
        cloudiness=25,
        precipitation=0,
        precipitation_deposits=0,
        wetness=0,
        wind_intensity=10,
        sun_azimuth_deg=(np.degrees(yaw_rad) + 180.0 - _SUN_BESIDE_DEG) % 360.0,
        sun_altitude_deg=46,
        fog_density=0,
        fog_distance_m=0,
        fog_falloff=1,
    )


def _cells(tiles: Sequence[Tile], tag: Tag) -> Float64Array:
    """(N, 2) centres of the cells in plan in which something of this tag is."""
    places = [tile.mesh.vertices[tile.mesh.tag == tag, :2] + tile.origin_m[:2] for tile in tiles]
    cells = np.unique(np.floor(np.concatenate([np.empty((0, 2)), *places]) / _CELL_M), axis=0)
    return np.asarray((cells + 0.5) * _CELL_M)


def _in_view(position_m: Float64Array, yaw_rad: Float64Array, cells_m: Float64Array) -> Float64Array:
    """(P,) how much of the cells can be seen from places: near ones count more; -inf where one is too near."""
    score = np.zeros(len(position_m))
    for k, (place_m, yaw) in enumerate(zip(position_m, yaw_rad, strict=True)):
        offset_m = cells_m - place_m[:2]
        ahead_m = offset_m @ np.array([np.cos(yaw), np.sin(yaw)])
        aside_m = np.abs(offset_m @ np.array([-np.sin(yaw), np.cos(yaw)]))
        seen = (ahead_m > _NEAR_M) & (ahead_m < _FAR_M) & (aside_m < 0.7 * ahead_m)
        score[k] = (
            np.sum(1.0 / ahead_m[seen]) if not np.any((ahead_m > 0) & (np.hypot(ahead_m, aside_m) < 2.5)) else 0.0
        )
    return score
