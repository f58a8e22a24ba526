"""Coarse stand-ins of plants for distant cameras, compared with the exact plants."""

import cv2
import numpy as np
import pytest
from render_scene import car, front_pose, plane, world

from simbev_ros.assets.flora.species import stock
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, Tile
from simbev_ros.assets.placement.tiles import TileBuilder, upright_pose
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.semantics import Tag
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = pytest.mark.gl

VIEW = CameraView(
    PinholeCamera.from_field_of_view(1600, 900, float(np.radians(80.0))), front_pose(), ("semantic", "depth")
)


def draw_trees(nearest_m: float, *, exact: bool) -> CameraImages:
    """Images of rows of trees beyond a distance, in tiles with or without stand-ins."""
    builder = TileBuilder()
    for k, name in enumerate(("lime", "poplar", "birch", "spruce", "pine", "hazel")):
        positions_m = [(nearest_m + 15.0 * row, 16.0 * k - 40.0 + 5.0 * row) for row in range(4)]
        builder.place_copies(stock(name, 0), np.stack([upright_pose(position_m, 0.0) for position_m in positions_m]))
    tiles = builder.finish()
    assert all(tile.detail for tile in tiles)
    if exact:
        tiles = tuple(Tile(tile.origin_m, tile.mesh, {}) for tile in tiles)
    ground = Tile(np.zeros(3), Mesh.merge([plane(600.0, 0.0, Tag.TERRAIN, Material.GRASS)]), {})
    renderer = Renderer(StaticScene((ground, *tiles), ()), [car()])
    [images] = renderer.render([VIEW], RenderFrame(world({"id": 1})))
    renderer.close()
    return images


def test_nearby_the_exact_mesh_is_drawn() -> None:
    graded, exact = draw_trees(20.0, exact=False), draw_trees(20.0, exact=True)
    assert graded.depth is not None and exact.depth is not None
    near = (exact.depth > 0.0) & (exact.depth < 60.0)
    assert near.mean() > 0.2
    assert np.array_equal(graded.depth[near], exact.depth[near])
    assert np.array_equal(graded.semantic, exact.semantic)


def test_far_away_labels_differ_only_at_outlines_by_a_pixel() -> None:
    graded, exact = (images.semantic for images in (draw_trees(370.0, exact=False), draw_trees(370.0, exact=True)))
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
