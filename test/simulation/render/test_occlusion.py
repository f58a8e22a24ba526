"""Occlusion culling: never removes a visible object, and removes most hidden ones."""

from collections.abc import Iterator

import numpy as np
import pytest
from render_scene import CAMERA, NOON, box, car, front_pose, plane, world

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, Tile
from simbev_ros.config.modalities import MODALITIES
from simbev_ros.foundation.geometry.transforms import apply, inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import BoolArray, Float32Array, Float64Array
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.simulation.render.geometry.occlusion import Occluders
from simbev_ros.simulation.render.renderer import Renderer
from simbev_ros.simulation.render.view import FAR_M, NEAR_M, View

EGO = {"id": 1}
CAMERA_VIEW = CameraView(CAMERA, front_pose(), MODALITIES)
[VIEW] = View.of_camera(CAMERA_VIEW, world(EGO), None, np.zeros(3))
EVENING = NOON.model_copy(update={"sun_azimuth_deg": 185.0, "sun_altitude_deg": 12.0})


def buffer_depth(depth_m: Float64Array | float) -> Float32Array:
    """Depth buffer value of a depth along the optical axis."""
    return np.float32(FAR_M / (FAR_M - NEAR_M) * (1.0 - NEAR_M / np.asarray(depth_m)))


def wall(depth_m: float) -> Float32Array:
    """A depth buffer with everything at one depth."""
    return np.full((CAMERA.height_px, CAMERA.width_px), buffer_depth(depth_m))


def around(
    depth_m: float, half_m: float, pixel: tuple[float, float] = (80.0, 45.0)
) -> tuple[Float64Array, Float64Array]:
    """Low and high corner of a cube around the point that a pixel shows at a depth."""
    center_m = apply(VIEW.world_from_optical, CAMERA.rays(np.array([pixel])) * depth_m)
    return center_m - half_m, center_m + half_m


def test_a_box_is_hidden_only_behind_the_wall() -> None:
    occluders = Occluders(wall(20.0))
    assert occluders.hidden(VIEW, *around(25.0, 1.0)).all()
    assert not occluders.hidden(VIEW, *around(15.0, 1.0)).any()
    assert not occluders.hidden(VIEW, *around(20.5, 1.0)).any(), "it sticks out of the wall"
    assert not occluders.hidden(VIEW, *around(2000.0, 1999.9)).any(), "the camera is in the box"


@pytest.mark.parametrize("hole", [(0, 0), (89, 159), (37, 61)])
def test_one_pixel_without_a_wall_shows_the_box_behind_it(hole: tuple[int, int]) -> None:
    depth = wall(20.0)
    depth[hole] = 1.0
    row, column = hole
    occluders = Occluders(depth)
    assert not occluders.hidden(VIEW, *around(40.0, 0.05, (column, row))).any()
    assert occluders.hidden(VIEW, *around(40.0, 0.05, (abs(column - 30), abs(row - 30)))).all()


def test_a_box_with_a_farther_pixel_in_its_rectangle_is_not_hidden() -> None:
    """Compare with a search of all pixels, for a wall with many one-pixel holes and boxes of all sizes."""
    rng = np.random.default_rng(5)
    depth = wall(20.0)
    depth[tuple(rng.integers(0, [[90], [160]], (2, 8)))] = 1.0
    pixels = rng.uniform([-20, -20], [180, 110], (2000, 2))
    centers = apply(VIEW.world_from_optical, CAMERA.rays(pixels) * rng.uniform(10.0, 90.0, (2000, 1)))
    halves = rng.uniform(0.05, 8.0, (2000, 3))
    hidden = Occluders(depth).hidden(VIEW, centers - halves, centers + halves)
    behind = np.array([_is_behind(depth, center, half) for center, half in zip(centers, halves, strict=True)])
    assert not (hidden & ~behind).any()
    assert hidden.sum() > 0.5 * behind.sum() > 100


def _is_behind(depth: Float32Array, center: Float64Array, half: Float64Array) -> bool:
    """Whether every pixel of the box's rectangle is nearer than the box."""
    signs = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(8, 3)
    corners = apply(inverse(VIEW.world_from_optical), center + signs * half)
    if corners[:, 2].min() <= NEAR_M:
        return False
    corner_pixels = CAMERA.project(corners)
    low = np.clip(np.floor(corner_pixels.min(axis=0)), 0, [159, 89]).astype(int)
    high = np.clip(np.ceil(corner_pixels.max(axis=0)), 0, [159, 89]).astype(int)
    seen = depth[low[1] : high[1] + 1, low[0] : high[0] + 1]
    return bool(seen.max() < buffer_depth(corners[:, 2].min()))


def town() -> StaticScene:
    """A street between two walls that hide blocks of many small houses, in tiles of several pieces each."""
    rng = np.random.default_rng(7)
    street = [
        plane(400.0, 0.0, Tag.ROAD, Material.ASPHALT),
        box((8, 6, 0), (60, 9, 7), Tag.WALL),
        box((4, -12, 0), (60, -8, 6), Tag.WALL),
    ]
    tiles = [Tile(np.zeros(3), Mesh.merge(street), {})]
    for x in (40.0, 80.0, 140.0, 220.0):
        for y in (-40.0, 0.0, 40.0):
            corners = rng.uniform([-18, -25, 0], [18, 25, 0.5], (60, 3))
            corners = corners[np.argsort(corners[:, 1])]  # so that a piece is a compact part of the tile
            houses = [box(tuple(c), tuple(c + rng.uniform(1, 6, 3)), Tag.BUILDING, Material.BRICK) for c in corners]
            tiles.append(Tile(np.array([x, y, 0.0]), Mesh.merge(houses), {}))
    return StaticScene(tuple(tiles), ())


def crowd(**ego: float) -> WorldState:
    """Cars on the street, behind both walls, and behind the camera with the low sun at their backs."""
    rng = np.random.default_rng(9)
    positions = [
        *rng.uniform([10, -5], [70, 5], (4, 2)),
        *rng.uniform([15, 12], [90, 40], (12, 2)),
        (-4.0, 3.0),
        (-9.0, -4),
    ]
    others = [{"id": 2 + k, "x": x, "y": y, "yaw": k} for k, (x, y) in enumerate(positions)]
    return world({**EGO, **ego}, *others, weather=EVENING)


def draw(renderer: Renderer, x_m: float, yaw_rad: float) -> CameraImages:
    pose = matrices_from_xyz_rpy(np.array([0.5, 0.1, 1.6]), np.array([0.0, 0.05, yaw_rad]))
    frame = RenderFrame(crowd(x=x_m), crowd(x=x_m - 0.5))
    return renderer.render([CameraView(CAMERA, pose, MODALITIES)], frame)[0]


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    renderer = Renderer(town(), [car()], use_compute=False)  # the GPU code path has no occlusion culling
    yield renderer
    renderer.close()


@pytest.mark.gl
@pytest.mark.parametrize(("x_m", "yaw_rad"), [(0.0, 0.1), (0.0, 0.6), (0.0, -0.8), (-6.0, 0.3), (25.0, 0.3)])
def test_culling_does_not_change_a_byte_of_any_image(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch, x_m: float, yaw_rad: float
) -> None:
    original, culled_counts = Occluders.hidden, []

    def count_hidden(self: Occluders, view: View, low_m: Float64Array, high_m: Float64Array) -> BoolArray:
        hidden = original(self, view, low_m, high_m)
        culled_counts.append(int(hidden.sum()))
        return hidden

    def all_visible(self: object, first: Float64Array, *others: object) -> BoolArray:
        return np.ones(len(first), bool)

    monkeypatch.setattr("simbev_ros.simulation.render.geometry.static_geometry._MIN_CULLED_TRIANGLES", 0)
    monkeypatch.setattr(Occluders, "hidden", count_hidden)
    images = draw(renderer, x_m, yaw_rad)
    monkeypatch.setattr(Occluders, "hidden", lambda self, view, low_m, high_m: np.zeros(len(low_m), bool))
    for name in ("sees_boxes", "sees_spheres", "sees_shadows"):
        monkeypatch.setattr(View, name, all_visible)
    expected = draw(renderer, x_m, yaw_rad)
    assert sum(culled_counts) > 2
    for modality in MODALITIES:
        assert getattr(images, modality).tobytes() == getattr(expected, modality).tobytes(), modality


@pytest.mark.gl
def test_a_car_behind_the_camera_casts_its_shadow_into_the_view(renderer: Renderer) -> None:
    with_car, without = (
        renderer.render([CAMERA_VIEW], RenderFrame(world(EGO, *cars, weather=EVENING)))[0]
        for cars in ([{"id": 2, "x": -3.0, "y": 2.0}], [])
    )
    assert with_car.rgb is not None and without.rgb is not None
    assert not with_car.instance.any()
    darker = with_car.rgb.astype(int).sum(axis=2) < without.rgb.astype(int).sum(axis=2) - 30
    assert darker.mean() > 0.01
