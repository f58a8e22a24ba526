"""What cameras far away see instead of plants, against the plants themselves."""

import cv2
import numpy as np
import pytest
from render_scene import car, front_pose, plane, world

from simbev_ros.assets.flora.species import stock
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, Tile
from simbev_ros.assets.placement.tiles import TileBuilder, standing
from simbev_ros.geometry.camera import PinholeCamera
from simbev_ros.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.render.renderer import Renderer
from simbev_ros.semantics import Tag

pytestmark = pytest.mark.gl

VIEW = CameraView(
    PinholeCamera.from_field_of_view(1600, 900, float(np.radians(80.0))), front_pose(), ("semantic", "depth")
)


def seen(nearest_m: float, *, exact: bool) -> CameraImages:
    """Rows of trees from a distance on, as tiles that have stand-ins or as tiles that do not."""
    builder = TileBuilder()
    for k, name in enumerate(("round", "tall", "birch", "spruce", "pine", "bush")):
        places_m = [(nearest_m + 15.0 * row, 16.0 * k - 40.0 + 5.0 * row) for row in range(4)]
        builder.place_copies(stock(name, 0), np.stack([standing(place_m, 0.0) for place_m in places_m]))
    tiles = builder.finish()
    assert all(tile.detail for tile in tiles)
    if exact:
        tiles = tuple(Tile(tile.origin_m, tile.mesh, {}) for tile in tiles)
    ground = Tile(np.zeros(3), Mesh.merged([plane(600.0, 0.0, Tag.TERRAIN, Material.GRASS)]), {})
    renderer = Renderer(StaticScene((ground, *tiles), ()), [car()])
    [images] = renderer.render([VIEW], RenderFrame(world({"id": 1})))
    renderer.close()
    return images


def test_nearby_only_the_exact_mesh_is_drawn() -> None:
    graded, exact = seen(20.0, exact=False), seen(20.0, exact=True)
    assert graded.depth is not None and exact.depth is not None
    near = (exact.depth > 0.0) & (exact.depth < 60.0)
    assert near.mean() > 0.2
    assert np.array_equal(graded.depth[near], exact.depth[near])
    assert np.array_equal(graded.semantic, exact.semantic)


def test_far_away_labels_change_only_at_outlines_and_by_a_pixel() -> None:
    graded, exact = (images.semantic for images in (seen(370.0, exact=False), seen(370.0, exact=True)))
    assert graded is not None and exact is not None
    is_tree, was_tree = (np.uint8(image == Tag.VEGETATION) for image in (graded, exact))
    assert was_tree.sum() > 2_000
    assert not np.array_equal(is_tree, was_tree)
    around = np.ones((5, 5), np.uint8)
    rim = cv2.dilate(was_tree, around) != cv2.erode(was_tree, around)
    assert (graded != exact)[~rim].mean() < 1e-3
    length_px = sum(
        cv2.arcLength(line, True) for line in cv2.findContours(is_tree, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
    )
    assert (graded != exact).sum() / length_px < 1.0
