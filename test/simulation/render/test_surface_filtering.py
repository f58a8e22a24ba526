"""Procedural surfaces from near and far: the same mean color, without flickering."""

from collections.abc import Iterator

import numpy as np
import pytest
from render_scene import NOON, actors, car, plane

from simbev_ros.assets.materials import Material
from simbev_ros.assets.placement.static_scene import StaticScene, Tile
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.schema.scene.state import SIGNAL_DTYPE, WorldState
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.simulation.render.gl.context import open_context
from simbev_ros.simulation.render.renderer import Renderer
from simbev_ros.simulation.render.shading.noise import noise_image, noise_texture

pytestmark = pytest.mark.gl

_CAMERA = PinholeCamera.from_field_of_view(320, 180, float(np.radians(60.0)))
_SMALL_CAMERA = PinholeCamera.from_field_of_view(160, 90, float(np.radians(60.0)))
_STEP_M = 0.05
_HALF_M = 400.0
_MATERIALS = ("ASPHALT", "MARKING", "PAVING", "CONCRETE", "GRASS", "SOIL", "CROP", "BRICK", "ROOF", "PLASTER")


def _photograph(
    renderer: Renderer, pose: Float64Array, x_m: float = 0.0, before_m: float | None = None
) -> CameraImages:
    """Color and flow from a camera on a car at x_m, which was at before_m one frame earlier."""
    previous = None if before_m is None else _world(before_m)
    [images] = renderer.render([CameraView(_CAMERA, pose, ("rgb", "flow"))], RenderFrame(_world(x_m), previous))
    return images


def _world(x_m: float) -> WorldState:
    return WorldState(0, 0, 1, actors({"id": 1, "x": x_m}), np.zeros(0, SIGNAL_DTYPE), NOON)


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    """Horizontal squares of all materials, side by side."""
    squares = [plane(_HALF_M, 0.0, Tag.ROAD, Material[name]) for name in _MATERIALS]
    tiles = [
        Tile(np.array([0.0, _offset_m(name), 0.0]), mesh, {}) for name, mesh in zip(_MATERIALS, squares, strict=True)
    ]
    result = Renderer(StaticScene(tuple(tiles), ()), [car()])
    yield result
    result.close()


def _offset_m(material: str) -> float:
    """Lateral position of the center of a material's square; the ego's shadow is outside the image."""
    return 1000.0 * (1 + _MATERIALS.index(material))


def _linear(rgb: np.ndarray) -> Float64Array:
    """Mean of an image's pixels, approximately linear in radiance."""
    mean: Float64Array = ((rgb.astype(np.float64) / 255.0) ** 2.2).mean(axis=(0, 1))
    return mean


@pytest.mark.parametrize("material", _MATERIALS)
def test_the_mean_color_is_the_same_from_near_and_far(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch, material: str
) -> None:
    monkeypatch.setattr("simbev_ros.simulation.render.lighting.light.CLEAR_HAZE_PER_M", 0.0)  # air has a color too
    means = []
    for height_m, x_positions_m in ((6.0, np.arange(12) * 17.3), (60.0, np.arange(2) * 111.0), (300.0, np.zeros(1))):
        positions_m = np.array([(x_m, _offset_m(material), height_m) for x_m in x_positions_m])
        poses = matrices_from_xyz_rpy(positions_m, np.tile((0.0, np.pi / 2.0, 0.0), (len(positions_m), 1)))
        views = [CameraView(_SMALL_CAMERA, pose, ("rgb",)) for pose in poses]
        images = renderer.render(views, RenderFrame(_world(0.0)))
        means.append(np.mean([_linear(image.rgb) for image in images], axis=0))
    assert np.abs(np.array(means) / means[1] - 1.0).max() < 0.09


@pytest.mark.parametrize(
    ("material", "max_difference"), [("ASPHALT", 2.5), ("PAVING", 2.2), ("GRASS", 3.5), ("BRICK", 2.5)]
)
def test_distant_surfaces_do_not_flicker_when_the_camera_moves(
    renderer: Renderer, material: str, max_difference: float
) -> None:
    pose = matrices_from_xyz_rpy(np.array([0.0, _offset_m(material), 1.6]), np.zeros(3))
    before = _photograph(renderer, pose, -_STEP_M).rgb
    now = _photograph(renderer, pose, 0.0, -_STEP_M)
    rows, columns = np.indices(now.rgb.shape[:2])
    mask = np.zeros(rows.shape, bool)
    mask[98:140, 20:-20] = True  # from 5 to 30 m
    previous_px = np.stack([columns, rows], axis=-1)[mask] - now.flow[mask]
    difference = now.rgb[mask].astype(np.float64) - _interpolate(before, previous_px)
    assert np.sqrt((difference**2).mean()) < max_difference


def _interpolate(image: np.ndarray, positions: Float64Array) -> Float64Array:
    """(N, 3) colors at (N, 2) positions, x and y, by bilinear interpolation."""
    first = np.floor(positions).astype(int)
    (x, y), (u, v) = first.T, (positions - first).T[..., None]
    upper = image[y, x] * (1.0 - u) + image[y, x + 1] * u
    lower = image[y + 1, x] * (1.0 - u) + image[y + 1, x + 1] * u
    return upper * (1.0 - v) + lower * v


def test_noise_is_uniformly_distributed_and_periodic() -> None:
    image = noise_image().astype(float)
    for channel in np.moveaxis(image, -1, 0):
        np.testing.assert_allclose(np.bincount(channel.astype(int).ravel(), minlength=256), 256, atol=1)
        steps = np.abs(np.diff(channel, axis=0)).mean()
        assert np.abs(channel[0] - channel[-1]).mean() < 1.25 * steps


@pytest.mark.parametrize("level", range(6))
def test_noise_has_the_same_mean_at_every_mipmap_level(level: int) -> None:
    context = open_context()
    texels = np.frombuffer(noise_texture(context).read(level=level), np.uint8).reshape(-1, 4)
    context.release()
    assert len(texels) == (256 >> level) ** 2
    np.testing.assert_allclose(texels.mean(axis=0), 127.5, atol=0.1)
