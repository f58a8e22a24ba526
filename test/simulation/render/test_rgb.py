"""The color image: correct light directions, and identical bytes for identical worlds."""

import hashlib
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from render_scene import NOON, box, car, plane, world

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, StreetLight, Tile
from simbev_ros.config.modalities import MODALITIES
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, apply, inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, UInt8Array
from simbev_ros.schema.scene.state import Light, WorldState
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.simulation.render.frame import CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = pytest.mark.gl

CAMERA = PinholeCamera.from_field_of_view(240, 180, 1.2)
DOWN = matrices_from_xyz_rpy(np.array([0.0, 0.0, 30.0]), np.array([0.0, np.pi / 2, 0.0]))
"""Looks straight down from 30 m; the top of the image is ahead of the ego."""
EGO = {"id": 1}
NIGHT = NOON.model_copy(update={"sun_altitude_deg": -40.0})


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    """A 6 m tower on level ground, and a street lamp to its right."""
    tower = box((-1, -1, 0), (1, 1, 6), Tag.BUILDING)
    ground = plane(100.0, 0.0, Tag.ROAD, Material.CONCRETE)
    lamp = StreetLight((0.0, -9.0, 7.5))
    return Renderer(StaticScene((Tile(np.zeros(3), Mesh.merge([ground, tower]), {}),), (lamp,)), [car()])


def photograph(renderer: Renderer, state: WorldState, pose: Float64Array = DOWN) -> UInt8Array:
    [images] = renderer.render([CameraView(CAMERA, pose, ("rgb",))], RenderFrame(state))
    assert images.rgb is not None and images.rgb.shape == (180, 240, 3) and images.rgb.flags.c_contiguous
    return images.rgb


def brightness(image: UInt8Array, point_ego: tuple[float, float, float], pose: Float64Array = DOWN) -> float:
    """Mean of 3 x 3 pixels around a point."""
    [[u, v]] = CAMERA.project(apply(inverse(pose @ SENSOR_FROM_OPTICAL), np.array([point_ego])))
    return float(image[round(v) - 1 : round(v) + 2, round(u) - 1 : round(u) + 2].mean())


@pytest.mark.parametrize("azimuth_deg", [0.0, 90.0, 200.0])
def test_shadow_direction_and_length_follow_the_sun(renderer: Renderer, azimuth_deg: float) -> None:
    weather = NOON.model_copy(update={"sun_azimuth_deg": azimuth_deg, "sun_altitude_deg": 45.0})
    image = photograph(renderer, world(EGO, weather=weather))
    away = -np.array([np.cos(np.radians(azimuth_deg)), np.sin(np.radians(azimuth_deg)), 0.0])
    lit = brightness(image, tuple(-away * 4.0))
    assert brightness(image, tuple(away * 4.0)) < 0.7 * lit
    assert brightness(image, tuple(away * 8.5)) > 0.9 * lit, "6 m high: the shadow ends 6 m from the tower"


def test_the_hidden_ego_casts_its_shadow(renderer: Renderer) -> None:
    weather = NOON.model_copy(update={"sun_azimuth_deg": 90.0, "sun_altitude_deg": 45.0})
    there = photograph(renderer, world({**EGO, "x": 10.0}, weather=weather))
    assert brightness(there, (0.0, -1.6, 0.0)) < 0.7 * brightness(there, (0.0, 1.6, 0.0))


def test_leaves_look_the_same_from_both_sides_and_other_faces_do_not() -> None:
    seen = {}
    for material in (Material.FOLIAGE, Material.WOOD):
        leaf = plane(3.0, 20.0, Tag.VEGETATION, material)
        turned = replace(leaf, triangles=np.ascontiguousarray(leaf.triangles[:, ::-1]))
        sides = []
        for mesh in (leaf, turned):
            renderer = Renderer(StaticScene((Tile(np.zeros(3), mesh, {}),), ()), [car()])
            sides.append(brightness(photograph(renderer, world(EGO)), (0.0, 0.0, 20.0)))
            renderer.close()
        seen[material] = sides
    assert seen[Material.FOLIAGE][0] == seen[Material.FOLIAGE][1]
    assert seen[Material.WOOD][0] > 1.3 * seen[Material.WOOD][1]


def test_clouds_hide_the_stars() -> None:
    renderer = Renderer(StaticScene((Tile(np.zeros(3), plane(1.0, 0.0, Tag.ROAD, Material.ASPHALT), {}),), ()), [car()])
    up = matrices_from_xyz_rpy(np.array([0.0, 0.0, 2.0]), np.array([0.0, -np.pi / 2, 0.0]))
    bright = []
    for cloudiness in (0.0, 100.0):
        weather = NIGHT.model_copy(update={"cloudiness": cloudiness})
        sky = photograph(renderer, world(EGO, weather=weather), up).astype(float).mean(axis=2)
        blurred = cv2.blur(sky, (9, 9))
        bright.append(int((sky > blurred + 12.0).sum()))
    renderer.close()
    assert bright[0] > 20
    assert bright[1] == 0


def test_night_is_darker_than_dusk_and_dusk_than_day(renderer: Renderer) -> None:
    means = [
        photograph(renderer, world(EGO, weather=NOON.model_copy(update={"sun_altitude_deg": altitude_deg}))).mean()
        for altitude_deg in (-60.0, 1.0, 60.0)
    ]
    assert means[0] < means[1] < means[2]
    assert means[0] > 5.0, "night must still be readable"


def test_a_street_lamp_lights_the_ground_below_it_only_at_night(renderer: Renderer) -> None:
    below, across = (0.0, -9.0, 0.0), (0.0, 12.0, 0.0)
    night = photograph(renderer, world(EGO, weather=NIGHT))
    assert brightness(night, below) > 1.5 * brightness(night, across)
    clouds = photograph(renderer, world(EGO, weather=NOON.model_copy(update={"cloudiness": 100.0})))
    assert brightness(clouds, below) == pytest.approx(brightness(clouds, across), rel=0.1)


def test_headlamps_light_the_road_ahead(renderer: Renderer) -> None:
    dark, lit = (
        photograph(renderer, world({**EGO, "x": -5.0, "y": 8.0, "lights": lights}, weather=NIGHT))
        for lights in (0, Light.LOW_BEAM)
    )
    assert brightness(lit, (10.0, 0.0, 0.0)) > 1.3 * brightness(dark, (10.0, 0.0, 0.0))
    assert brightness(lit, (-8.0, 0.0, 0.0)) < 1.1 * brightness(dark, (-8.0, 0.0, 0.0))


@pytest.mark.parametrize("weather", [NOON, NIGHT])
def test_brake_lamps_are_brighter_than_tail_lamps_and_these_than_none(renderer: Renderer, weather: Weather) -> None:
    ahead = {"id": 2, "x": 20.0, "y": 10.0}
    pose = matrices_from_xyz_rpy(np.array([10.0, 10.0, 1.0]), np.zeros(3))
    red = [
        brightness(
            photograph(renderer, world(EGO, {**ahead, "lights": lights}, weather=weather), pose),
            (17.75, 10, 0.95),
            pose,
        )
        for lights in (0, Light.LOW_BEAM, Light.LOW_BEAM | Light.BRAKE)
    ]
    assert red[0] < red[1] < red[2]


def test_repeated_rendering_gives_the_same_bytes(renderer: Renderer) -> None:
    state = world({**EGO, "x": -3.0, "y": 4.0}, {"id": 2, "x": 6.0, "y": 3.0})
    first = photograph(renderer, state)
    photograph(renderer, world({**EGO, "x": 90.0}, weather=NIGHT))
    np.testing.assert_array_equal(photograph(renderer, state), first)


def digest_of_all_images() -> str:
    """Digest of all modalities of a small scene, drawn by a fresh renderer."""
    from render_scene import front_pose, scene

    state, before = world(EGO, {"id": 2, "x": 9.0, "wheel": 1.0}), world({**EGO, "x": -0.4}, {"id": 2, "x": 8.5})
    [images] = Renderer(scene(), [car()]).render(
        [CameraView(CAMERA, front_pose(), MODALITIES)], RenderFrame(state, before)
    )
    digest = hashlib.sha256()
    for modality in MODALITIES:
        digest.update(getattr(images, modality).tobytes())
    return digest.hexdigest()


def test_two_contexts_and_two_processes_give_the_same_bytes() -> None:
    here = {digest_of_all_images() for _ in range(2)}
    program = "import test_rgb; print(test_rgb.digest_of_all_images())"
    there = subprocess.run([sys.executable, "-c", program], cwd=Path(__file__).parent, capture_output=True, check=True)
    assert here == {there.stdout.decode().strip()}
