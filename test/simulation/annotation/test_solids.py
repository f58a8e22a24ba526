import numpy as np
from exact_voxels import winding_numbers
from synthetic_world import box, mesh, sheet

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.flora.crowns import crown
from simbev_ros.assets.materials import Material
from simbev_ros.foundation.semantics import Tag
from simbev_ros.simulation.annotation.occupancy.solids import Solids


def count_open_edges(solids: Solids) -> int:
    """Number of edges of closed pieces that have more triangles on one side than on the other."""
    triangles = solids.triangles[solids.is_solid].astype(np.int64)
    start, end = triangles.reshape(-1), np.roll(triangles, -1, axis=1).reshape(-1)
    low, high = np.minimum(start, end), np.maximum(start, end)
    _, edge = np.unique(low * len(solids.points) + high, return_inverse=True)
    return int((np.bincount(edge, np.sign(end - start)) != 0).sum())


def test_all_pieces_of_every_actor_are_closed() -> None:
    for model in load_models():
        solids = Solids.from_mesh(model.mesh)
        assert solids.is_solid.all(), model.blueprint
        assert count_open_edges(solids) == 0, model.blueprint


def test_the_leaf_clusters_of_a_crown_are_closed_and_its_leaves_are_sheets() -> None:
    rng = np.random.default_rng(3)
    center_m, radii_m = np.array([0.0, 0.0, 6.0]), np.array([2.0, 2.2, 1.8])
    leafage = crown(rng, center_m, radii_m, 300, (60, 110, 50)).mesh
    solids = Solids.from_mesh(leafage)
    assert count_open_edges(solids) == 0
    assert (~solids.is_solid).sum() == 300
    closed = solids.points[solids.triangles[solids.is_solid]]
    around = winding_numbers(center_m + radii_m * rng.uniform(-1.0, 1.0, (60, 3)), closed)
    assert np.allclose(around, np.round(around), atol=1e-6)
    assert 0.1 < (around > 0.5).mean() < 0.9


def test_touching_pieces_are_separated_and_keep_their_tags() -> None:
    table, sign = box([0.0, 0.0, 0.5], [1.0, 1.0, 1.0]), sheet([-0.5, -0.5], [3.0, 3.0], 1.0)
    both = mesh(table, Tag.STATIC, Material.WOOD), mesh(sign, Tag.GROUND)
    merged = type(both[0]).merge(both)
    solids = Solids.from_mesh(merged)
    assert np.array_equal(solids.is_solid, merged.triangle_tag == Tag.STATIC)
    assert np.array_equal(solids.tag[solids.triangles[:, 0]], merged.triangle_tag)
    assert len(solids.points) == 8 + 4


def test_an_empty_mesh_has_no_pieces() -> None:
    assert len(Solids.from_mesh(mesh(np.zeros((0, 3, 3)), Tag.ROAD)).triangles) == 0
