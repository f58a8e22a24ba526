"""Snow, fallen leaves and flowers in images: they lie on the ground of the static world and nowhere else."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from render_scene import NOON, box, car, front_pose, plane, world

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, Tile
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import BoolArray, UInt8Array
from simbev_ros.simulation.render.frame import CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = pytest.mark.gl

VIEW = CameraView(PinholeCamera.from_field_of_view(640, 360, 1.4), front_pose(), ("rgb", "semantic"))


def draw(material: Material, **strewn: float) -> tuple[UInt8Array, UInt8Array]:
    """Color and tags of a level ground of a material with a house and a car on it."""
    ground = plane(200.0, 0.0, Tag.TERRAIN, material)
    if material == Material.ASPHALT:
        ground = replace(ground, color=np.full_like(ground.color, 0x4E))
    house = box((20, 4, 0), (30, 14, 8), Tag.BUILDING, Material.PLASTER)
    renderer = Renderer(StaticScene((Tile(np.zeros(3), Mesh.merge([ground, house]), {}),), ()), [car()])
    state = world({"id": 1}, {"id": 2, "x": 12.0, "y": -3.0}, weather=NOON.model_copy(update=strewn))
    [images] = renderer.render([VIEW], RenderFrame(state))
    renderer.close()
    assert images.rgb is not None and images.semantic is not None
    return images.rgb, images.semantic


def inside(semantic: UInt8Array, tag: Tag) -> BoolArray:
    return cv2.erode(np.uint8(semantic == tag), np.ones((9, 9), np.uint8)) > 0


@pytest.mark.parametrize("material", [Material.GRASS, Material.PAVING, Material.ASPHALT])
def test_snow_covers_the_ground_but_neither_walls_nor_vehicles(material: Material) -> None:
    bare, tags = draw(material)
    white, _ = draw(material, snow_cover=100.0)
    ground = inside(tags, Tag.TERRAIN)
    assert white[ground].mean() > bare[ground].mean() + (40.0 if material != Material.ASPHALT else 15.0)
    for tag in (Tag.BUILDING, Tag.CAR):
        assert np.array_equal(white[inside(tags, tag)], bare[inside(tags, tag)])


def test_traffic_clears_roads_of_some_of_the_snow() -> None:
    road, tags = draw(Material.ASPHALT, snow_cover=100.0)
    walk, _ = draw(Material.PAVING, snow_cover=100.0)
    ground = inside(tags, Tag.TERRAIN)
    assert road[ground].mean() < 0.9 * walk[ground].mean()


def test_fallen_leaves_are_brown_and_flowers_grow_in_grass_alone() -> None:
    grass, tags = draw(Material.GRASS)
    ground = inside(tags, Tag.TERRAIN)
    littered, _ = draw(Material.GRASS, leaf_litter=100.0)
    red, green, _ = (littered[ground].astype(float) - grass[ground]).mean(axis=0)
    assert (littered[ground] != grass[ground]).any(axis=1).mean() > 0.3
    assert red > green
    assert (draw(Material.GRASS, flowers=100.0)[0][ground] != grass[ground]).any()
    assert np.array_equal(draw(Material.ASPHALT, flowers=100.0)[0], draw(Material.ASPHALT)[0])
