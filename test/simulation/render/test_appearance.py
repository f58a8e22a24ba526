"""Random colors: none by default, others per seed, and never in labels."""

import numpy as np
import pytest
from render_scene import box, car, plane, world

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, Tile
from simbev_ros.config.appearance import Appearance
from simbev_ros.config.draw import Distribution
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.scene.drawing.draw_lights import draw_appearance
from simbev_ros.schema.scene.appearance import AppearanceSpec
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer

CAMERA = PinholeCamera.from_field_of_view(160, 120, 1.2)
AHEAD = matrices_from_xyz_rpy(np.array([0.0, 0.0, 1.6]), np.zeros(3))
WORLD = world({"id": 1}, {"id": 2, "x": 9.0, "y": 2.0})


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    walls = [box((20.0, 4.0 * k, 0), (26.0, 4.0 * k + 3.0, 6 + k), Tag.BUILDING) for k in range(-4, 4)]
    ground = plane(100.0, 0.0, Tag.ROAD, Material.CONCRETE)
    return Renderer(StaticScene((Tile(np.zeros(3), Mesh.merge([ground, *walls]), {}),), ()), [car()])


def _images(renderer: Renderer, appearance: AppearanceSpec) -> CameraImages:
    renderer.set_appearance(appearance)
    [images] = renderer.render(
        [CameraView(CAMERA, AHEAD, ("rgb", "semantic", "instance", "depth"))], RenderFrame(WORLD)
    )
    return images


@pytest.mark.gl
def test_only_the_color_image_depends_on_it(renderer: Renderer) -> None:
    plain, random = (_images(renderer, AppearanceSpec(seed=5, randomize=share)) for share in (0.0, 1.0))
    assert np.abs(plain.rgb.astype(int) - random.rgb).mean() > 10.0  # type: ignore[union-attr]
    for name in ("semantic", "instance", "depth"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(random, name))


@pytest.mark.gl
def test_a_seed_has_its_own_colors_and_without_strength_none(renderer: Renderer) -> None:
    first = _images(renderer, AppearanceSpec(seed=1, randomize=0.7)).rgb
    other = _images(renderer, AppearanceSpec(seed=2, randomize=0.7)).rgb
    again = _images(renderer, AppearanceSpec(seed=1, randomize=0.7)).rgb
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    without = [_images(renderer, AppearanceSpec(seed=seed)).rgb for seed in (1, 2)]
    np.testing.assert_array_equal(*without)


def test_strength_is_drawn_per_scene() -> None:
    drawn = [draw_appearance(Appearance(randomize=Distribution(uniform=(0.2, 0.6))), seed) for seed in range(50)]
    assert all(0.2 <= spec.randomize <= 0.6 for spec in drawn)
    assert len({spec.randomize for spec in drawn}) == 50
    assert draw_appearance(Appearance(), 3).randomize == 0.0
