"""A picture from the street: the renderer's view on a sunny day."""

import numpy as np

from simbev_ros.assets.catalogue import load_models
from simbev_ros.assets.static_scene import StaticScene
from simbev_ros.geometry.camera import PinholeCamera
from simbev_ros.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.render.frame import CameraView, RenderFrame
from simbev_ros.render.renderer import Renderer
from simbev_ros.scene.state import ACTOR_DTYPE, EGO_ID, SIGNAL_DTYPE, SignalState, WorldState
from simbev_ros.scene.weather import Weather
from simbev_ros.semantics import Tag
from simbev_ros.types import Float64Array, UInt8Array
from simbev_ros.viz.street_traffic import bystanders

_WIDTH_PX, _HEIGHT_PX = 1600, 900
_FIELD_OF_VIEW_RAD = np.radians(72.0)
_EYE_M = 2.4
_BEHIND_M = 6.0  # the car that every scene has stands so far behind the camera
_SUN_BESIDE_DEG = 26.0  # the sun stands behind the camera, so far to the side


def street_view(network: RoadNetwork, static: StaticScene, place_m: Float64Array, yaw_rad: float) -> UInt8Array:
    """(900, 1600, 3) uint8 RGB of what a driver sees there, signals on green, with others on the road.

    Raises:
        RenderError: OpenGL is not usable here.
    """
    behind_m = place_m - _BEHIND_M * np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
    models = load_models()
    ego = np.zeros(1, ACTOR_DTYPE)
    ego["x"], ego["y"], ego["z"] = behind_m
    ego["yaw"], ego["id"], ego["tag"] = yaw_rad, EGO_ID, Tag.CAR
    ego["blueprint"] = next(k for k, model in enumerate(models) if model.tag == Tag.CAR)
    actors = np.concatenate([ego, bystanders(network, place_m, EGO_ID + 1)])
    signals = np.zeros(len(network.signals), SIGNAL_DTYPE)
    signals["state"] = SignalState.GREEN
    world = WorldState(0, 0, EGO_ID, actors, signals, _fair_weather(yaw_rad))
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
