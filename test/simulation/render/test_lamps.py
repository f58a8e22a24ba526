"""Lamps light the right surfaces, in their colors, from their positions, and nothing else."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from render_scene import NOON, actors, box, car, plane, world

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, StreetLight, Tile
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, apply, inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, UInt8Array
from simbev_ros.schema.scene.lights import LightSpec, StreetLightSpec
from simbev_ros.schema.scene.state import Light, WorldState
from simbev_ros.simulation.render.frame import CameraView, RenderFrame
from simbev_ros.simulation.render.lighting.lamp_shadows import DIRECTIONS, FREE_M, HALF_ANGLE_RAD, free_distances
from simbev_ros.simulation.render.lighting.lamps import VehicleLamps
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = pytest.mark.gl

CAMERA = PinholeCamera.from_field_of_view(320, 240, 1.2)
NIGHT = NOON.model_copy(update={"sun_altitude_deg": -40.0, "cloudiness": 100.0})
WALL_X_M, DECK_Z_M, DECK_X_M = 22.2, 6.5, -60.0
DOWN = np.array([0.0, np.pi / 2, 0.0])
EGO = {"id": 1, "x": 0.0, "y": -70.0}
"""The ego is away from the scene and only carries the camera."""


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    """Level ground with a wall 20 m in front of the lamps of a car at the origin, and a bridge with a lamp behind."""
    ground = plane(150.0, 0.0, Tag.ROAD, Material.CONCRETE)
    wall = box((WALL_X_M, -12.0, 0.0), (WALL_X_M + 1.0, 12.0, 6.0), Tag.BUILDING)
    deck = box((DECK_X_M - 8.0, -30.0, DECK_Z_M - 1.0), (DECK_X_M + 8.0, 30.0, DECK_Z_M), Tag.ROAD, Material.CONCRETE)
    lamp = StreetLight((DECK_X_M, 0.0, DECK_Z_M + 7.8))
    mesh = Mesh.merge([ground, wall, deck])
    renderer = Renderer(StaticScene((Tile(np.zeros(3), mesh, {}),), (lamp,)), [car()])
    yield renderer
    renderer.close()


def photograph(renderer: Renderer, state: WorldState, eye_m: tuple[float, ...], rpy: Float64Array) -> UInt8Array:
    """The image from a position in the map."""
    pose = matrices_from_xyz_rpy(np.array(eye_m) - [EGO["x"], EGO["y"], 0.0], rpy)
    [images] = renderer.render([CameraView(CAMERA, pose, ("rgb",))], RenderFrame(state))
    assert images.rgb is not None
    return images.rgb


def sample_colors(
    image: UInt8Array, eye_m: tuple[float, ...], rpy: Float64Array, *points_m: tuple[float, ...]
) -> Float64Array:
    """(N, 3) colors of points in the map, means of 3 x 3 pixels."""
    optical_from_map = inverse(matrices_from_xyz_rpy(np.array(eye_m), rpy) @ SENSOR_FROM_OPTICAL)
    pixels = np.rint(CAMERA.project(apply(optical_from_map, np.array(points_m)))).astype(int)
    return np.array([image[v - 1 : v + 2, u - 1 : u + 2].mean(axis=(0, 1)) for u, v in pixels])


def at_night(*rows: dict[str, float], **weather: float) -> WorldState:
    return world(EGO, *rows, weather=NIGHT.model_copy(update=weather))


def wall_brightness(
    renderer: Renderer, positions: list[tuple[float, float]], **other: float
) -> tuple[Float64Array, Float64Array]:
    """(N,) brightness of the wall at (y, z) with and without the car's light."""
    eye_m, rpy = (8.0, 6.0, 3.5), np.array([0.0, 0.15, -0.4])
    points_m = [(WALL_X_M, y_m, z_m) for y_m, z_m in positions]
    lit, dark = (
        sample_colors(
            photograph(renderer, at_night({"id": 2, **other, "lights": lights}), eye_m, rpy), eye_m, rpy, *points_m
        )
        for lights in (int(other.get("lights", Light.LOW_BEAM)), 0)
    )
    return lit.mean(axis=1), dark.mean(axis=1)


def test_a_low_beam_ends_1_percent_below_the_lamps_and_rises_on_the_right(renderer: Renderer) -> None:
    # Lamps 0.7 m high, 20 m in front of the wall: cutoff at 0.5 m; 2 m to the right it rises by 15 degrees.
    lit, dark = wall_brightness(renderer, [(1.5, 0.25), (1.5, 1.0), (-2.6, 0.85), (1.5, 0.85)])
    below, above, right, left = lit / dark
    assert min(below, right) > 4.0
    assert max(above, left) < 1.6, "only stray light"


def test_a_high_beam_and_a_pitched_car_light_higher(renderer: Renderer) -> None:
    positions = [(0.5, 1.3)]
    lit, dark = wall_brightness(renderer, positions)
    assert lit[0] < 1.6 * dark[0]
    for other in ({"lights": Light.LOW_BEAM | Light.HIGH_BEAM}, {"pitch": -0.06}):
        lit, dark = wall_brightness(renderer, positions, **other)
        assert lit[0] > 3.0 * dark[0]


def test_a_car_casts_a_shadow_in_headlights(renderer: Renderer) -> None:
    eye_m, beyond_m = (14.0, 0.0, 16.0), (15.5, 0.0, 0.0)
    brightness = []
    for lights, across_m in ((0, 6.0), (Light.LOW_BEAM, 6.0), (Light.LOW_BEAM, 0.0)):
        state = at_night({"id": 2, "lights": lights}, {"id": 3, "x": 10.0, "y": across_m})
        brightness.append(sample_colors(photograph(renderer, state, eye_m, DOWN), eye_m, DOWN, beyond_m).mean())
    dark, free, hidden = brightness
    assert free > 1.5 * dark
    assert hidden < dark + 0.25 * (free - dark)


@pytest.mark.parametrize(("light", "warm"), [(Light.BRAKE, True), (Light.EMERGENCY, False)])
def test_lamps_tint_the_road(renderer: Renderer, light: Light, warm: bool) -> None:
    eye_m = (0.0, 0.0, 14.0)
    behind_m, ahead_m = (-4.6, 0.0, 0.0), (4.6, 0.0, 0.0)
    on, off = (
        sample_colors(
            photograph(renderer, at_night({"id": 2, "lights": lights}), eye_m, DOWN), eye_m, DOWN, behind_m, ahead_m
        )
        for lights in (light, 0)
    )
    gain = on - off
    if warm:
        assert gain[0, 0] > 15.0 > 4.0 > gain[0, 2]
        assert np.abs(gain[1]).max() < 2.0
    else:
        assert gain[:, 2].max() > 15.0 > 5.0 > gain[:, 0].max()


def test_a_beacon_rotates_with_time_and_is_reproducible(renderer: Renderer) -> None:
    state = at_night({"id": 2, "lights": Light.EMERGENCY})
    first, later, next_turn = (
        photograph(renderer, replace(state, stamp_ns=stamp_ns), (0.0, 0.0, 20.0), DOWN).astype(int)
        for stamp_ns in (0, 125_000_000, 500_000_000)
    )
    assert np.abs(first - next_turn).max() < 8, "but for the clouds, which drift"
    assert np.abs(first - later).max() > 20


def test_lamps_do_not_shine_through_a_bridge(renderer: Renderer) -> None:
    eye_m, rpy = (DECK_X_M - 20.0, 0.0, 2.0), np.array([0.0, 0.1, 0.0])
    below_m = (DECK_X_M - 3.0, 0.0, 0.0)
    car_above = {"id": 2, "x": DECK_X_M - 12.0, "z": DECK_Z_M}
    colors = {}
    for name, lights, enabled in (("dark", 0, False), ("street", 0, True), ("beams", Light.LOW_BEAM, False)):
        renderer.set_lights(LightSpec(street=StreetLightSpec(enabled=enabled)))
        image = photograph(renderer, at_night({**car_above, "lights": lights}), eye_m, rpy)
        colors[name] = sample_colors(image, eye_m, rpy, below_m)
        above_m = (DECK_X_M, 0.0, DECK_Z_M + 12.0)
        deck = photograph(renderer, at_night({**car_above, "lights": lights}), above_m, DOWN)
        colors[f"{name} deck"] = sample_colors(deck, above_m, DOWN, (DECK_X_M - 3.0, 0.0, DECK_Z_M))
    renderer.set_lights(LightSpec())
    for name in ("street", "beams"):
        assert colors[f"{name} deck"].mean() > 1.3 * colors["dark deck"].mean()
        np.testing.assert_allclose(colors[name], colors["dark"], atol=1.5)


def test_distant_lamps_are_points_of_light_unless_occluded(renderer: Renderer) -> None:
    eye_m, rpy = (20.0, 60.0, 1.2), np.zeros(3)
    there = {"id": 2, "x": 320.0, "y": 60.0, "yaw": np.pi}
    points = []
    for lights, *others in ((0,), (Light.LOW_BEAM,), (Light.LOW_BEAM, {"id": 3, "x": 60.0, "y": 60.0})):
        image = photograph(renderer, at_night({**there, "lights": lights}, *others), eye_m, rpy)
        points.append(sample_colors(image, eye_m, rpy, (317.8, 60.0, 0.7)).mean())
    dark, lit, hidden = points
    assert lit > dark + 40.0
    assert hidden < dark + 20.0


def test_wet_roads_reflect_lamps(renderer: Renderer) -> None:
    eye_m, rpy = (-15.0, 40.0, 1.5), np.array([0.0, 0.05, 0.0])
    ahead = {"id": 2, "x": 15.0, "y": 40.0}
    mirrored_m = (-1.0, 40.3, 0.0)  # outside the brake lamps' own light
    gains = []
    for wetness in (0.0, 80.0):
        dark, lit = (
            sample_colors(
                photograph(renderer, at_night({**ahead, "lights": lights}, wetness=wetness), eye_m, rpy),
                eye_m,
                rpy,
                mirrored_m,
            )[0]
            for lights in (0, Light.BRAKE)
        )
        gains.append(lit - dark)
    assert abs(gains[0][0]) < 2.0
    assert gains[1][0] > 10.0 > gains[1][2]


def test_a_shop_front_lights_the_pavement_in_front_of_it() -> None:
    ground = plane(60.0, 0.0, Tag.SIDEWALK, Material.PAVING)
    corners = np.array([[0.0, y, z] for y, z in ((-6, 0), (6, 0), (6, 3), (-6, 3))])[[[0, 1, 2], [0, 2, 3]]]
    front = Mesh.flat(corners[:, ::-1], material=Material.SHOPFRONT, tag=Tag.BUILDING, color=(90, 90, 90))
    renderer = Renderer(StaticScene((Tile(np.zeros(3), Mesh.merge([ground, front]), {}),), ()), [car()])
    eye_m, facing = (0.0, 0.0, 20.0), float(np.sign(front.normals[0, 0]))
    before_m, behind_m = (2.0 * facing, 0.0, 0.0), (-2.0 * facing, 0.0, 0.0)
    before, behind = sample_colors(photograph(renderer, at_night(), eye_m, DOWN), eye_m, DOWN, before_m, behind_m)
    renderer.close()
    assert before.mean() > 1.4 * behind.mean()
    assert before[0] > before[2], "windows shine warmly"


def test_free_distances_end_at_the_nearest_boxes() -> None:
    table = actors({"id": 1}, {"id": 2, "x": 12.0, "yaw": 0.3}, {"id": 3, "x": 8.0, "z": 9.0}, {"id": 4, "parent": 1})
    table["lights"][0] = Light.LOW_BEAM
    lamps = VehicleLamps([car()]).lit_lamps(table, np.zeros(3))
    lamps = lamps[lamps["beam"] > 0]
    assert lamps["beam"].tolist() == [1, 1]
    np.testing.assert_allclose(np.sort(lamps["at"][:, 1]), [-0.6, 0.6], atol=1e-6)
    distances = free_distances(lamps, table, np.zeros(3))
    half_m = np.array([table["length"][1] / 2.0 - 0.3, table["width"][1] / 2.0 - 0.3])
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]]) * half_m
    cos, sin = np.cos(0.3), np.sin(0.3)
    corners = corners @ np.array([[cos, sin], [-sin, cos]]) + [12.0, 0.0]
    angles = (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS * 2.0 * HALF_ANGLE_RAD - HALF_ANGLE_RAD
    for lamp, found in zip(lamps, distances, strict=True):
        expected = np.full(DIRECTIONS, FREE_M)
        for start, end in pairwise(corners):
            for index, angle in enumerate(angles):
                ray = np.array([np.cos(angle), np.sin(angle)])
                along, share = np.linalg.solve(np.column_stack([ray, start - end]), start - lamp["at"][:2])
                if along > 0.0 and 0.0 <= share <= 1.0:
                    expected[index] = min(expected[index], along)
        np.testing.assert_allclose(found, expected, rtol=1e-4)
