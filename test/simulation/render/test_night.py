"""At night, working street lights glow and light the road, broken ones do neither; windows have the scene's colors."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from render_scene import NOON, box, car, plane, world

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, StreetLight, Tile
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, apply, inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, UInt8Array
from simbev_ros.schema.scene.lights import BuildingLightSpec, LightSpec, StreetLightSpec, street_lights
from simbev_ros.simulation.render.frame import CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = pytest.mark.gl

CAMERA = PinholeCamera.from_field_of_view(240, 180, 1.2)
ALONG = matrices_from_xyz_rpy(np.array([-25.0, 0.0, 3.0]), np.zeros(3))
NIGHT = NOON.model_copy(update={"sun_altitude_deg": -40.0})
LAMPS_M = np.array([[5.0, 16.0, 7.0], [5.0, -16.0, 7.0]])
WALL_X_M, WALL_M = 60.0, 30.0


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    """Two street lamps on the left and right, and far ahead a wall of 10 x 10 windows beyond their range."""
    pieces = [plane(100.0, 0.0, Tag.ROAD, Material.CONCRETE)]
    for index, (x_m, y_m, z_m) in enumerate(LAMPS_M):
        half_m = 0.6
        lamp = box(
            (x_m - half_m, y_m - half_m, z_m - half_m),
            (x_m + half_m, y_m + half_m, z_m + half_m),
            Tag.POLE,
            Material.STREET_LAMP,
        )
        pieces.append(replace(lamp, uv=np.full_like(lamp.uv, index)))
    (y_m, z_m) = (WALL_M / 2.0, WALL_M)
    corners = np.array([[WALL_X_M, y, z] for y, z in ((y_m, 0), (-y_m, 0), (-y_m, z_m), (y_m, z_m))])
    wall = Mesh.flat(corners[[[0, 1, 2], [0, 2, 3]]], material=Material.FACADE, tag=Tag.BUILDING, color=(90, 90, 90))
    pieces.append(
        replace(wall, uv=np.column_stack([y_m - wall.vertices[:, 1], wall.vertices[:, 2]]).astype(np.float32))
    )
    lights = tuple(StreetLight((x, y, z)) for x, y, z in LAMPS_M.tolist())
    renderer = Renderer(StaticScene((Tile(np.zeros(3), Mesh.merge(pieces), {}),), lights), [car()])
    yield renderer
    renderer.close()


def photograph(renderer: Renderer, lights: LightSpec, altitude_deg: float = -40.0) -> UInt8Array:
    renderer.set_lights(lights)
    state = world({"id": 1}, weather=NIGHT.model_copy(update={"sun_altitude_deg": altitude_deg}))
    [images] = renderer.render([CameraView(CAMERA, ALONG, ("rgb",))], RenderFrame(state))
    assert images.rgb is not None
    return images.rgb


def brightness(image: UInt8Array, points_m: Float64Array) -> list[float]:
    pixels = np.rint(CAMERA.project(apply(inverse(ALONG @ SENSOR_FROM_OPTICAL), points_m))).astype(int)
    return [float(image[v - 1 : v + 2, u - 1 : u + 2].mean()) for u, v in pixels]


def seed_with(failed: list[bool]) -> LightSpec:
    """Lights with exactly the given failures."""
    street = StreetLightSpec(failure_probability=0.4)
    every = (LightSpec(seed=seed, street=street) for seed in count())
    return next(lights for lights in every if street_lights(lights, LAMPS_M)["failed"].astype(bool).tolist() == failed)


@pytest.mark.parametrize("failed", [[True, False], [False, True]])
def test_a_broken_lamp_is_dark_and_a_working_one_lights_the_road(renderer: Renderer, failed: list[bool]) -> None:
    broken, working = (LAMPS_M[failed.index(state)] for state in (True, False))
    image = photograph(renderer, seed_with(failed))
    positions_m = np.array([broken, working, broken * [1, 1, 0], working * [1, 1, 0]])
    dark_lamp, glow, dark_road, pool = brightness(image, positions_m)
    assert glow > 200.0 > 3.0 * dark_lamp
    assert pool > 2.0 * dark_road
    nothing = photograph(renderer, LightSpec(street=StreetLightSpec(enabled=False)))
    assert brightness(nothing, positions_m)[2] == pytest.approx(dark_road, abs=6.0)


def test_more_lumens_are_brighter(renderer: Renderer) -> None:
    below = LAMPS_M * [1, 1, 0]
    seen = [
        brightness(photograph(renderer, LightSpec(street=StreetLightSpec(base_lm=flux_lm))), below)[0]
        for flux_lm in (10_000.0, 18_000.0, 36_000.0)
    ]
    assert seen[1] > 1.1 * seen[0]
    assert seen[2] > 1.1 * seen[1]


def test_by_day_the_settings_have_no_effect(renderer: Renderer) -> None:
    off = LightSpec(street=StreetLightSpec(enabled=False), buildings=BuildingLightSpec(enabled=False))
    np.testing.assert_array_equal(photograph(renderer, LightSpec(), 20.0), photograph(renderer, off, 20.0))


def lit_windows(image: UInt8Array) -> tuple[float, UInt8Array]:
    """Share of the 10 x 10 windows that are lit, and (N, 3) their colors, each from the brightest of nine pixels."""
    bay_m = np.arange(10) * 3.0
    along_m, up_m = np.meshgrid(bay_m + 1.75, bay_m + 1.2)
    positions_m = np.column_stack([np.full(100, WALL_X_M), WALL_M / 2.0 - along_m.ravel(), up_m.ravel()])
    pixels = np.rint(CAMERA.project(apply(inverse(ALONG @ SENSOR_FROM_OPTICAL), positions_m))).astype(int)
    u, v = (pixels[:, None] + np.mgrid[-1:2, -1:2].reshape(2, 9).T).T
    colors = image[v, u]  # (9, 100, 3)
    colors = colors[colors.max(axis=2).argmax(axis=0), np.arange(100)]
    lit = colors.max(axis=1) > 50
    return float(lit.mean()), colors[lit]


def test_windows_have_the_scenes_colors_and_share(renderer: Renderer) -> None:
    shares = {}
    for share in (0.0, 0.3, 0.8):
        buildings = BuildingLightSpec(share_lit=share, colors=(0xFF4040, 0x4040FF))
        shares[share], colors = lit_windows(photograph(renderer, LightSpec(seed=2, buildings=buildings)))
    assert shares[0.0] == 0.0
    assert shares[0.3] == pytest.approx(0.3, abs=0.12)
    assert shares[0.8] == pytest.approx(0.8, abs=0.12)
    red, _, blue = colors.astype(int).T
    assert np.all(np.abs(red - blue) > 20), "each window has one of the two colors"
    assert 0.25 < np.mean(red > blue) < 0.75


def test_buildings_can_be_switched_off(renderer: Renderer) -> None:
    assert lit_windows(photograph(renderer, LightSpec()))[0] > 0.1
    assert lit_windows(photograph(renderer, LightSpec(buildings=BuildingLightSpec(enabled=False))))[0] == 0.0
