"""Roads and sidewalks are not alike in all quarters of a town."""

import numpy as np
import pytest
from render_scene import car, plane, world

from simbev_ros.assets.materials import Material
from simbev_ros.assets.placement.static_scene import StaticScene, Tile
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.render.frame import CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = pytest.mark.gl

CAMERA = PinholeCamera.from_field_of_view(160, 160, np.pi / 2)
DOWN = matrices_from_xyz_rpy(np.array([0.0, 0.0, 600.0]), np.array([0.0, np.pi / 2, 0.0]))


def _lightness(material: Material) -> Float64Array:
    """Gray levels of a square of 1.2 km of one color."""
    ground = Tile(np.zeros(3), plane(700.0, 0.0, Tag.SIDEWALK, material), {})
    renderer = Renderer(StaticScene((ground,), ()), [car()])
    [images] = renderer.render([CameraView(CAMERA, DOWN, ("rgb",))], RenderFrame(world({"id": 1})))
    assert images.rgb is not None
    return images.rgb.mean(axis=2)


@pytest.mark.parametrize(("material", "ratio"), [(Material.ASPHALT, 1.25), (Material.PAVING, 1.4)])
def test_quarters_differ_in_lightness(material: Material, ratio: float) -> None:
    low, high = np.percentile(_lightness(material), [3, 97])
    assert high > ratio * low
