"""Inside a tunnel, images depend on its lamps, not on sun, sky, rain or fog."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from analytic_maps import ground_tiles, tunnel
from render_scene import NOON, car
from synthetic_world import EGO_ID, actor

from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.config.optics import Exposure, Optics
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.region import Region
from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.schema.scene.state import SIGNAL_DTYPE, WorldState
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.simulation.render.frame import CameraView, RenderFrame
from simbev_ros.simulation.render.lighting.tunnel_map import TunnelMap
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = pytest.mark.slow

CAMERA = PinholeCamera.from_field_of_view(160, 90, 1.2)
POSE = matrices_from_xyz_rpy(np.array([0.0, 0.0, 1.8]), np.zeros(3))
NIGHT = NOON.model_copy(update={"sun_altitude_deg": -25.0})
RAIN = NOON.model_copy(update={"precipitation": 90.0, "precipitation_deposits": 90.0, "wetness": 90.0})
FOG = NOON.model_copy(update={"fog_density": 80.0})
DEEP_M, OUTSIDE_M = 230.0, 100.0
FIXED = Optics(exposure=Exposure(f_number=16.0, time_s=0.01, iso=100.0))


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    network = tunnel()
    tiles = ground_tiles(RegionGround.from_network(network, Region(0, 0), Terrain(network)))
    made = Renderer(StaticScene(tiles, (), Tunnels.of_layout(network.layout)), [car()])
    yield made
    made.close()


def picture(renderer: Renderer, x_m: float, weather: Weather, optics: Optics | None = None) -> np.ndarray:
    """(90, 160, 3) image along the street, in 0..1."""
    ego = actor(car(), x=x_m, y=254.0, id=EGO_ID)
    world = WorldState(0, 0, EGO_ID, ego, np.zeros(0, SIGNAL_DTYPE), weather)
    view = CameraView(CAMERA, POSE, ("rgb",), **({} if optics is None else {"optics": optics}))
    [images] = renderer.render([view], RenderFrame(world, None, show_ego=False))
    assert images.rgb is not None
    return images.rgb / 255.0


def test_day_and_night_look_the_same_deep_inside(renderer: Renderer) -> None:
    day, night = picture(renderer, DEEP_M, NOON)[45:], picture(renderer, DEEP_M, NIGHT)[45:]
    assert 0.05 < day.mean() < 0.6
    assert np.abs(day[10:] - night[10:]).mean() < 0.04
    assert picture(renderer, OUTSIDE_M, NOON).mean() > 2.0 * picture(renderer, OUTSIDE_M, NIGHT).mean()


@pytest.mark.parametrize("weather", [RAIN, FOG])
def test_rain_and_fog_stay_outside(renderer: Renderer, weather: Weather) -> None:
    inside = np.abs(picture(renderer, DEEP_M, weather)[55:] - picture(renderer, DEEP_M, NOON)[55:]).mean()
    outside = np.abs(picture(renderer, OUTSIDE_M, weather)[55:] - picture(renderer, OUTSIDE_M, NOON)[55:]).mean()
    assert inside < 0.03
    assert outside > 3.0 * inside


def test_the_opening_is_darker_than_the_street_by_day_and_brighter_by_night(renderer: Renderer) -> None:
    before_m = 140.0
    opening, street = np.s_[37:43, 64:98], np.s_[75:, 60:110]
    day, night = picture(renderer, before_m, NOON), picture(renderer, before_m, NIGHT)
    assert day[opening].mean() < 0.6 * day[street].mean()
    assert night[opening].mean() > night[street].mean()


def test_a_camera_with_fixed_exposure_does_not_adapt(renderer: Renderer) -> None:
    adapted, fixed = (picture(renderer, DEEP_M, NOON, optics)[45:].mean() for optics in (None, FIXED))
    assert fixed < 0.5 * adapted


def test_maps_of_agents_inside_and_outside_are_kept_and_do_not_mix(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn, draw_around = [], TunnelMap._draw_around

    def count(tunnel_map: TunnelMap, *values: Any) -> None:
        drawn.append(values)
        draw_around(tunnel_map, *values)

    monkeypatch.setattr(TunnelMap, "_draw_around", count)
    counts, pictures = {}, {}
    for agents in (1, 2):
        renderer.set_agents(agents)
        for turn in range(3):
            drawn.clear()
            pictures[agents, turn] = [picture(renderer, x_m, NOON) for x_m in (DEEP_M, OUTSIDE_M)]
            counts[agents, turn] = len(drawn)
    assert (counts[1, 1], counts[1, 2]) == (2, 2), "each agent takes the other one's map"
    assert (counts[2, 1], counts[2, 2]) == (0, 0)
    for inside, outside in pictures.values():
        np.testing.assert_array_equal(inside, pictures[1, 0][0])
        np.testing.assert_array_equal(outside, pictures[1, 0][1])
