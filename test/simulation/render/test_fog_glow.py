"""Halos of lamps in fog: against the integral of light that is scattered once, and without effect in clear air."""

import numpy as np
import pytest
from render_scene import NOON, box, car, plane, world

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, StreetLight, Tile
from simbev_ros.config.modalities import MODALITIES
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.schema.scene.state import Light
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.simulation.render.lighting.light import SkyLight
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = pytest.mark.gl

CAMERA = PinholeCamera.from_field_of_view(320, 240, float(np.radians(80)))
LAMP_M = np.array([20.0, 0.0, 8.0])
EYE_M = np.array([0.0, 0.0, 2.0])
STEP_PX = 8


def foggy(density: float, **values: float) -> Weather:
    return NOON.model_copy(update={"sun_altitude_deg": -25.0, "fog_density": density, "fog_falloff": 0.0, **values})


def create_renderer(*meshes: Mesh) -> Renderer:
    ground = plane(300.0, 0.0, Tag.ROAD, Material.ASPHALT)
    lamps = (StreetLight((20.0, 0.0, 8.0)),)
    return Renderer(StaticScene((Tile(np.zeros(3), Mesh.merge([ground, *meshes]), {}),), lamps), [car()])


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    """A plain with a street lamp 20 m ahead."""
    return create_renderer()


def draw(renderer: Renderer, weather: Weather, *rows: dict[str, float]) -> CameraImages:
    pose = matrices_from_xyz_rpy(EYE_M, np.zeros(3))
    state = world({"id": 1}, *rows, weather=weather)
    return renderer.render([CameraView(CAMERA, pose, MODALITIES)], RenderFrame(state))[0]


def halos(renderer: Renderer) -> Float64Array:
    """(30, 40, 3) light that the air adds, before the camera's response."""
    _, small = renderer._shading.fog_glow._halos[CAMERA.width_px, CAMERA.height_px]
    with renderer._context:
        data = np.frombuffer(small.read(components=3, alignment=1), np.uint8)
    return -np.log2(1.0 - data.reshape(-1, CAMERA.width_px // STEP_PX, 3) / 256.0)


def scattered_light(direction: Float64Array, weather: Weather) -> float:
    """Light of the lamp that fog scatters once into a ray that ends nowhere, by its integral; green channel."""
    depth_per_m = 0.06 * (weather.fog_density / 100.0) ** 2 * np.log(2.0)
    along_m = np.linspace(0.0, 400.0, 400_001)
    from_lamp = EYE_M + along_m[:, None] * direction - LAMP_M
    away_m = np.linalg.norm(from_lamp, axis=1)
    from_lamp /= away_m[:, None]
    ahead = np.maximum(-from_lamp[:, 2], 0.0)
    candela = 2200.0 * (1.0 + 0.6 * (ahead**2 - 1.0))
    cosine = -(from_lamp @ direction)
    phase = (1.0 - 0.36) / (1.36 - 1.2 * cosine) ** 1.5
    light = candela * phase * np.exp(-depth_per_m * (along_m + away_m)) / away_m**2
    radiance = 0.009 / 4.0 * depth_per_m * 0.78 * np.trapezoid(light, along_m)
    return float(radiance * SkyLight.from_weather(weather).exposure)


def texel_of(position_m: tuple[float, float, float]) -> tuple[int, int]:
    """Row and column of the halos that show a position."""
    ahead_m, left_m, up_m = np.array(position_m) - EYE_M
    x_px, y_px = CAMERA.cx_px - CAMERA.fx_px * left_m / ahead_m, CAMERA.cy_px - CAMERA.fy_px * up_m / ahead_m
    return round(y_px / STEP_PX), round(x_px / STEP_PX)


@pytest.mark.parametrize("aside_m", [(0.0, 2.0), (3.0, 0.0), (-5.0, -3.0), (0.0, -4.0)])
def test_a_halo_is_the_integral_of_the_light_scattered_once(renderer: Renderer, aside_m: tuple[float, float]) -> None:
    weather = foggy(60.0)
    draw(renderer, weather)
    row, column = texel_of((LAMP_M[0], LAMP_M[1] + aside_m[0], LAMP_M[2] + aside_m[1]))
    x_px, y_px = column * STEP_PX, row * STEP_PX
    ray = np.array([1.0, -(x_px - CAMERA.cx_px) / CAMERA.fx_px, -(y_px - CAMERA.cy_px) / CAMERA.fy_px])
    direction = ray / np.linalg.norm(ray)
    apart_m = np.linalg.norm(np.cross(LAMP_M - EYE_M, direction))
    shown = 1.0 - (apart_m**2 + 0.02) / 18.0**2  # halos end at 18 m from the lamp
    assert halos(renderer)[row, column, 1] == pytest.approx(
        shown * scattered_light(direction, weather), rel=0.06, abs=0.004
    )


def test_a_halo_fades_with_the_angle_from_its_lamp_and_grows_with_fog(renderer: Renderer) -> None:
    row, column = texel_of(tuple(LAMP_M))
    totals = []
    for density in (20.0, 40.0, 60.0):
        draw(renderer, foggy(density))
        line = halos(renderer)[row, column:, 1]
        assert np.all(np.diff(line[1:]) <= 1e-6)
        totals.append(line.sum())
    assert totals == sorted(totals)
    assert totals[0] > 0.0


def test_rain_makes_a_faint_halo(renderer: Renderer) -> None:
    draw(renderer, foggy(60.0))
    in_fog = halos(renderer).max()
    draw(renderer, foggy(0.0, precipitation=80.0))
    assert 0.0 < halos(renderer).max() < 0.4 * in_fog


@pytest.mark.parametrize("weather", [foggy(0.0), foggy(60.0, sun_altitude_deg=30.0)], ids=["clear night", "foggy day"])
def test_clear_air_and_unlit_lamps_make_no_difference(weather: Weather, monkeypatch: pytest.MonkeyPatch) -> None:
    renderer = create_renderer()
    image = draw(renderer, weather).rgb
    monkeypatch.setattr(renderer._shading.fog_glow, "draw", lambda _: None)
    np.testing.assert_array_equal(draw(renderer, weather).rgb, image)
    assert renderer._shading.fog_glow._passes is None


def test_halos_change_nothing_but_the_color(renderer: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    glowing = draw(renderer, foggy(60.0))
    monkeypatch.setattr(renderer._shading.fog_glow, "draw", lambda _: None)
    dull = draw(renderer, foggy(60.0))
    added = glowing.rgb.astype(int) - dull.rgb
    assert added.min() >= 0
    assert added.max() > 60
    for name in ("semantic", "instance", "depth", "flow"):
        np.testing.assert_array_equal(getattr(glowing, name), getattr(dull, name))


def test_a_wall_hides_the_halo_behind_it() -> None:
    walled = create_renderer(box((10.0, -9.0, 0.0), (10.2, 9.0, 14.0), Tag.WALL))
    draw(walled, foggy(60.0))
    assert halos(walled)[texel_of(tuple(LAMP_M))].max() == 0.0


def test_a_headlamp_lights_the_fog_ahead_of_it_but_not_above() -> None:
    renderer = create_renderer()
    renderer._lamp_field._strengths[:] = 0.0
    crossing = {"id": 2, "x": 16.0, "y": -6.0, "yaw": np.pi / 2.0, "lights": float(Light.LOW_BEAM)}
    draw(renderer, foggy(60.0), crossing)
    found = halos(renderer)[..., 1]
    ahead = found[texel_of((18.0, 2.0, 0.55))]
    assert ahead > 0.01
    assert ahead > 3.0 * found[texel_of((18.0, -14.0, 0.55))]
    assert ahead > 2.0 * found[texel_of((18.0, 2.0, 6.0))]
