import cv2
import numpy as np
import pytest

from simbev_ros.assets.flora.ivy import ivy
from simbev_ros.assets.flora.species import VARIANTS, load_species, reach_m, stock
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.graded import GradedMesh
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box
from simbev_ros.assets.placement.tiles import TileBuilder, upright_pose
from simbev_ros.assets.street.barriers import panel
from simbev_ros.config.weather import SEASONS
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import UInt8Array

PIXEL_M = 0.03
TREES = {name for name, species in load_species().items() if species.tree}
LARGE = {*TREES, "pine", "stone_pine"}
FORMS = {name: species.tree or species.shrub for name, species in load_species().items()}
CHANGING = {"thicket", "light_broad_leaved", *(name for name, form in FORMS.items() if form and not form.evergreen)}
BARE = CHANGING & TREES
HEIGHT_M = {  # minimum and maximum in the stock, as species.yaml and docstrings state
    "lime": (8.6, 12.2),
    "oak": (9.0, 12.6),
    "poplar": (12.5, 17.2),
    "cherry": (4.6, 6.5),
    "birch": (8.6, 11.7),
    "spruce": (9.0, 12.7),
    "cypress": (7.5, 11.8),
    "hazel": (0.9, 1.9),
}


def outline(mesh: Mesh, yaw_rad: float, pixel_m: float = PIXEL_M) -> UInt8Array:
    """(H, W) pixels that the mesh covers in a side view, upside down."""
    across_m = mesh.vertices[:, :2] @ np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
    pixel = np.round((np.stack([across_m + 9.0, mesh.vertices[:, 2] + 5.0], axis=1) / pixel_m) * 16.0).astype(np.int32)
    picture = np.zeros((round(22.0 / pixel_m), round(18.0 / pixel_m)), np.uint8)
    for triangle in pixel[mesh.triangles]:
        cv2.fillConvexPoly(picture, triangle, 1, shift=4)
    return picture


@pytest.mark.parametrize("name", load_species())
def test_a_plant_stands_upright_on_its_foot(name: str) -> None:
    for variant in range(VARIANTS):
        mesh = stock(name, variant).mesh
        assert mesh.vertices[:, 2].min() < 0.05
        assert mesh.vertices[:, 2].max() > 0.3
        assert np.hypot(*mesh.vertices[:, :2].mean(axis=0)) < 0.5 * reach_m(name)
        assert (mesh.tag == Tag.VEGETATION).all()


@pytest.mark.parametrize("name", load_species())
def test_plants_cost_few_triangles_and_fewer_from_afar(name: str) -> None:
    max_triangles, max_coarse_triangles = (750, 100) if name in LARGE else (430, 300)
    if name.startswith("light") or load_species()[name].shrub or name == "thicket":
        max_triangles, max_coarse_triangles = 180, 60
    for variant in range(VARIANTS):
        plant = stock(name, variant)
        assert len(plant.mesh.triangles) <= max_triangles
        assert len(plant.coarse.triangles) <= max_coarse_triangles


@pytest.mark.parametrize(("name", "height_m"), HEIGHT_M.items())
def test_plants_of_a_species_have_the_documented_height(name: str, height_m: tuple[float, float]) -> None:
    for variant in range(VARIANTS):
        assert height_m[0] < stock(name, variant).mesh.vertices[:, 2].max() < height_m[1]


@pytest.mark.parametrize("name", load_species())
def test_a_stand_in_has_the_outline_of_its_plant(name: str) -> None:
    """On average, an outline is off by less than a pixel of a camera of 1600 pixels and 80 degrees 190 m away."""
    for yaw_rad in (0.3, 1.7):
        exact, coarse = (outline(mesh, yaw_rad) for mesh in (stock(name, 1).mesh, stock(name, 1).coarse))
        rims, _ = cv2.findContours(coarse, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        length_px = sum(cv2.arcLength(rim, True) for rim in rims)
        assert (exact & ~coarse).sum() / length_px * PIXEL_M < 0.2
        assert (coarse & ~exact).sum() / length_px * PIXEL_M < 0.2
        assert 0.7 < coarse.sum() / exact.sum() < 1.25


def test_a_stand_in_has_the_colors_of_its_plant() -> None:
    for name in LARGE:
        plant = stock(name, 0)
        exact, coarse = (mesh.color[mesh.triangles[:, 0]].mean(axis=0) for mesh in (plant.mesh, plant.coarse))
        assert np.abs(exact - coarse).max() < 12.0
        assert (plant.coarse.tag == Tag.VEGETATION).all()


def test_hedges_join_without_gaps_in_both_levels_of_detail() -> None:
    hedge = panel("hedge", 0)
    assert isinstance(hedge, GradedMesh)
    for mesh in (hedge.mesh, hedge.coarse):
        ends = [mesh.vertices[np.isclose(mesh.vertices[:, 0], x_m)][:, 1:] for x_m in (0.0, 2.4)]
        first, last = (np.unique(np.round(end, 4), axis=0) for end in ends)
        assert np.array_equal(first, last)
    assert len(hedge.coarse.triangles) < 0.3 * len(hedge.mesh.triangles)


def test_a_tile_ends_with_the_objects_that_have_a_stand_in() -> None:
    tiles, plain, tree = TileBuilder(), stock("agave", 0).mesh, stock("birch", 0)
    poses = np.stack(
        [upright_pose((10.0, 10.0), 2.0), upright_pose((20.0, 5.0), 3.0, 1.0), upright_pose((-10.0, 5.0), 0.0)]
    )
    tiles.place_copies(tree, poses)
    tiles.place_copies(plain, poses[:1])
    west, east = tiles.finish()
    assert (west.detail, east.detail) == (len(tree.mesh.triangles), 2 * len(tree.mesh.triangles))
    assert len(east.mesh.triangles) == east.detail + len(plain.triangles)
    assert len(east.coarse.triangles) == 2 * len(tree.coarse.triangles)
    corners = east.mesh.vertices[east.mesh.triangles[-len(tree.mesh.triangles) :]]
    alone = tree.mesh.transform(upright_pose(poses[1, :2, 3] - east.origin_m[:2], 3.0, 1.0))
    assert np.allclose(corners, alone.vertices[alone.triangles], atol=1e-4)
    middle_m = [mesh.vertices.mean(axis=0) for mesh in (west.mesh, west.coarse)]
    assert np.hypot(*(middle_m[0] - middle_m[1])[:2]) < 0.3


@pytest.mark.parametrize("name", sorted(BARE))
def test_a_bare_tree_lets_most_of_the_sky_through_and_is_as_large_as_in_summer(name: str) -> None:
    for variant in range(VARIANTS):
        bare, full = (stock(name, variant, season) for season in ("winter", "summer"))
        pictures = [outline(plant.mesh, 0.4, 0.01) for plant in (bare, full)]
        high = slice(round((5.0 + 0.5 * full.mesh.vertices[:, 2].max()) / 0.01), None)
        assert 0.2 < pictures[0][high].sum() / pictures[1][high].sum() < 0.65
        assert np.abs(bare.mesh.bounds_m[1, 2] - full.mesh.bounds_m[1, 2]) < 1.3
        assert all(np.hypot(*plant.mesh.vertices[:, :2].T).max() <= reach_m(name) for plant in (bare, full))
        assert len(bare.mesh.triangles) <= 1350 and len(bare.coarse.triangles) <= 330


def test_trunks_are_the_same_in_all_seasons_and_evergreens_do_not_change() -> None:
    for name in load_species():
        plants = [stock(name, 2, season).mesh for season in SEASONS]
        if name in BARE:
            trunks = [mesh.vertices[mesh.vertices[:, 2] < 0.5] for mesh in plants]
            assert all(np.array_equal(trunk, trunks[0]) for trunk in trunks)
        elif name not in CHANGING:
            assert all(np.array_equal(mesh.color, plants[0].color) for mesh in plants)


@pytest.mark.parametrize("name", ["lime", "oak", "poplar", "birch"])
def test_a_bare_stand_in_covers_about_as_much_as_its_tree(name: str) -> None:
    exact, coarse = (
        outline(mesh, 0.3, 0.01) for mesh in (stock(name, 1, "winter").mesh, stock(name, 1, "winter").coarse)
    )
    blurred = [
        cv2.resize(picture.astype(np.float32), (37, 45), interpolation=cv2.INTER_AREA) for picture in (exact, coarse)
    ]
    assert 0.7 < coarse.sum() / exact.sum() < 1.3
    assert np.abs(blurred[0] - blurred[1]).sum() / blurred[0].sum() < 0.5


def test_ivy_grows_close_to_a_wall_and_leaves_its_windows_free() -> None:
    wall = box(Finish(Material.BRICK_FACADE, Tag.BUILDING, (140, 80, 60)), (12.0, 0.4, 9.0), (0.0, 0.0, 4.5))
    for seed in range(6):
        leaves = ivy(np.random.default_rng(seed), wall, 400)
        middles = leaves.vertices[leaves.triangles].mean(axis=1)
        outside_m = np.maximum(np.abs(middles[:, :2]) - [6.0, 0.2], 0.0).max(axis=1)
        assert len(middles) > 20 and outside_m.max() < 0.4 and middles[:, 2].min() > -0.5
        assert (leaves.tag == Tag.VEGETATION).all()
        front = np.abs(middles[:, 0]) < 5.5
        pane = np.abs(np.mod(middles[front][:, [0, 2]], 3.0) - [1.5, 1.6]).max(axis=1) < 0.45
        assert pane.sum() < 0.1 * len(middles)
    road = box(Finish(Material.ASPHALT, Tag.ROAD, (60, 60, 60)), (9.0, 9.0, 0.2))
    assert len(ivy(np.random.default_rng(1), road, 400).triangles) == 0
