"""Renders pictures from the street: a driver's view in any weather, with actors on the roads and sidewalks.

A map, its static scene, a position and a direction enter; camera images leave. Needs OpenGL, but no ROS graph.
"""

from collections.abc import Sequence
from typing import Self

import numpy as np

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.config.modalities import Modality
from simbev_ros.config.rendering import Quality
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Table, UInt8Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.schema.scene.state import ACTOR_DTYPE, EGO_ID, SIGNAL_DTYPE, Light, SignalState, WorldState
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.show.street.street_traffic import bystanders
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer

SIZE_PX = (1600, 900)
"""Default width and height of pictures."""

_FIELD_OF_VIEW_RAD = np.radians(72.0)
_EYE_M = 2.4
_BEHIND_M = 6.0  # distance of the mandatory ego car behind the camera
_SUN_BESIDE_DEG = 26.0  # angle of the sun from the direction straight behind the camera
_BRAKING_INTERVAL = 4  # every Nth vehicle stands and shows its brake lights
_FRAME_S = 0.05
_WHEEL_RADIUS_M = 0.33
_SPEED_MPS = 9.0  # speed of vehicles that do not brake


class StreetView:
    """A viewpoint on a street that can be photographed in several weathers.

    As a context manager it frees its GPU resources on exit.

    Args:
        network: The map.
        static: The static scene of the map.
        position_m: (3,) position on the ground, map frame.
        yaw_rad: Viewing direction, map frame.
        quality: Quality of color images.
        busy: Density of other traffic; 1 is usual.

    Raises:
        RenderError: OpenGL is not usable here.
    """

    def __init__(
        self,
        network: RoadNetwork,
        static: StaticScene,
        position_m: Float64Array,
        yaw_rad: float,
        quality: Quality = "medium",
        busy: float = 1.0,
    ) -> None:
        models = load_models()
        ego = np.zeros(1, ACTOR_DTYPE)
        ego["x"], ego["y"], ego["z"] = position_m - _BEHIND_M * np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
        ego["yaw"], ego["id"], ego["tag"] = yaw_rad, EGO_ID, Tag.CAR
        ego["blueprint"] = next(k for k, model in enumerate(models) if model.tag == Tag.CAR)
        self._actors: Table = np.concatenate([ego, bystanders(network, position_m, EGO_ID + 1, busy)])
        self._driving = self._actors["tag"] != Tag.PEDESTRIAN
        self._braking = self._driving & (self._actors["id"] % _BRAKING_INTERVAL == 0)
        rolling = self._driving & ~self._braking
        yaws_rad = self._actors["yaw"][rolling]
        self._actors["vx"][rolling], self._actors["vy"][rolling] = (
            _SPEED_MPS * np.cos(yaws_rad),
            _SPEED_MPS * np.sin(yaws_rad),
        )
        self._signals = np.zeros(len(network.signals), SIGNAL_DTYPE)
        self._signals["state"] = SignalState.GREEN
        self._yaw_rad = yaw_rad
        self._renderer = Renderer(static, models, quality=quality)

    def photograph(
        self, weather: Weather, size_px: tuple[int, int] = SIZE_PX, modalities: Sequence[Modality] = ("rgb",)
    ) -> CameraImages:
        """Render the view in a weather, with all signals green.

        Args:
            weather: The weather.
            size_px: Width and height of the images.
            modalities: The modalities to render; optical flow is that over the last 50 ms.
        """
        actors = self._actors.copy()
        actors["lights"][self._driving] = Light.LOW_BEAM if weather.needs_low_beam else 0
        actors["lights"][self._braking] |= np.uint16(Light.BRAKE)
        world = WorldState(0, 0, EGO_ID, actors, self._signals, weather)
        before = WorldState(0, 0, EGO_ID, _a_frame_before(actors), self._signals, weather)
        camera = PinholeCamera.from_field_of_view(*size_px, float(_FIELD_OF_VIEW_RAD))
        pose = matrices_from_xyz_rpy(np.array([_BEHIND_M, 0.0, _EYE_M]), np.zeros(3))
        [images] = self._renderer.render([CameraView(camera, pose, modalities)], RenderFrame(world, before))
        return images

    def sun_azimuth_deg(self, bearing_deg: float) -> float:
        """Azimuth of the sun in the map for an angle from the viewing direction to the sun, to the left, degrees."""
        return float((np.degrees(self._yaw_rad) + bearing_deg) % 360.0)

    def fair_weather(self) -> Weather:
        """Weather of a sunny day, with the sun behind the camera."""
        return Weather(
            cloudiness=25,
            precipitation=0,
            precipitation_deposits=0,
            wetness=0,
            wind_intensity=10,
            sun_azimuth_deg=self.sun_azimuth_deg(180.0 - _SUN_BESIDE_DEG),
            sun_altitude_deg=46,
            fog_density=0,
            fog_distance_m=0,
            fog_falloff=1,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._renderer.close()


def street_view(network: RoadNetwork, static: StaticScene, position_m: Float64Array, yaw_rad: float) -> UInt8Array:
    """Render the view from a position on a sunny day, without keeping the renderer.

    Args:
        network: The map.
        static: The static scene of the map.
        position_m: (3,) position on the ground, map frame.
        yaw_rad: Viewing direction, map frame.

    Returns:
        (900, 1600, 3) uint8 RGB.

    Raises:
        RenderError: OpenGL is not usable here.
    """
    with StreetView(network, static, position_m, yaw_rad) as view:
        images = view.photograph(view.fair_weather())
    assert images.rgb is not None
    return images.rgb


def _a_frame_before(actors: Table) -> Table:
    """The actors one frame earlier, assuming straight motion at constant speed."""
    before: Table = actors.copy()
    before["x"] -= actors["vx"] * _FRAME_S
    before["y"] -= actors["vy"] * _FRAME_S
    before["wheel"] -= np.hypot(actors["vx"], actors["vy"]) * _FRAME_S / _WHEEL_RADIUS_M
    return before
