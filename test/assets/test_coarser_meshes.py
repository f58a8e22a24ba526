import numpy as np
import open3d as o3d
import pytest
from catalog_models import blueprint, few_derived, model

from simbev_ros.assets.actors.actor_model import CoarserMesh
from simbev_ros.assets.actors.detail import COARSER, COARSER_FIGURES, EXACT, Detail
from simbev_ros.assets.actors.doors import door_parts
from simbev_ros.assets.actors.lofting import build_shell
from simbev_ros.assets.actors.shape import load_shape
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.blueprints import load_blueprints

NAMES = [entry.name for entry in load_blueprints()]
WITH_SHELLS = [name for name in NAMES if load_shape(name).shells]
SAMPLE = ["vehicle.sedan", "vehicle.van", "vehicle.bus", "vehicle.bicycle", "pedestrian.man", "prop.traffic_cone"]
SAMPLE += ["pedestrian.woman.robe.headscarf.shoulder_bag", "pedestrian.man.suit.glasses.briefcase"]


def coarser(name: str) -> tuple[CoarserMesh, ...]:
    return model(name).build_coarser()


def distances_m(points: Float64Array, mesh: Mesh) -> Float64Array:
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor(mesh.vertices), o3d.core.Tensor(mesh.triangles.astype(np.uint32)))
    return scene.compute_distance(o3d.core.Tensor(points.astype(np.float32))).numpy().astype(np.float64)


def surface_points(mesh: Mesh, count: int) -> Float64Array:
    """(count, 3) points spread evenly over a mesh's surface."""
    random = np.random.default_rng(3)
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = random.choice(len(corners), count, p=area / area.sum())
    weights = random.dirichlet(np.ones(3), count)
    return np.einsum("nk,nki->ni", weights, corners[chosen])


def open_edges(mesh: Mesh) -> Float64Array:
    """(E, 2, 3) edges that no neighboring triangle shares in the opposite direction."""
    positions, joined = np.unique(np.round(mesh.vertices.astype(np.float64), 5), axis=0, return_inverse=True)
    start, end = joined.reshape(-1)[mesh.triangles][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).T
    is_open = np.isin(start * len(positions) + end, end * len(positions) + start, invert=True)
    return positions[np.stack([start[is_open], end[is_open]], axis=1)]


@pytest.mark.parametrize("name", few_derived(WITH_SHELLS))
def test_bodies_have_no_gap_at_a_seam_in_any_detail(name: str) -> None:
    shape = load_shape(name)
    index = {name: number for number, name in enumerate(["body", *(part.name for part in door_parts(shape.doors))])}
    for shell in shape.shells:
        for detail in (EXACT, *COARSER):
            edges = open_edges(build_shell(shell, blueprint(name).tag, index, detail)[0])
            # At a square end of a box, several points of one straight edge face a single edge: no gap either.
            assert np.abs(np.ptp(edges[..., [0, 2]], axis=1)).max(initial=0.0) < 1e-4


@pytest.mark.parametrize("name", few_derived(SAMPLE))
def test_coarser_meshes_are_as_near_to_the_exact_one_as_they_say(name: str) -> None:
    exact = model(name).mesh
    for level in coarser(name):
        off_m = distances_m(surface_points(level.mesh, 4000), exact)
        assert np.quantile(off_m, 0.99) < level.error_m + 1e-3
        assert np.sqrt(np.mean(off_m**2)) < 0.5 * level.error_m + 1e-3


@pytest.mark.parametrize("name", few_derived(NAMES))
def test_coarser_meshes_have_the_parts_and_nearly_the_extent_of_the_exact_one_and_fewer_triangles(name: str) -> None:
    exact, levels = model(name).mesh, coarser(name)
    counts = [len(exact.triangles), *(len(level.mesh.triangles) for level in levels)]
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] < 0.55 * counts[0] or counts[0] < 600
    details = COARSER_FIGURES if load_shape(name).figure else COARSER
    assert [level.error_m for level in levels] == [detail.error_m for detail in details]
    for level in levels[: 4 if "cycle" in name else 5]:  # in the coarsest level a handlebar is too thin to be built
        assert set(level.mesh.part.tolist()) <= set(exact.part.tolist())
        np.testing.assert_allclose(level.mesh.bounds_m, exact.bounds_m, atol=2.0 * level.error_m + 1e-4)


def test_a_round_object_has_as_many_sides_as_its_error_requires() -> None:
    sides = Detail(0.01).segments(64, 0.33)
    assert 0.33 * (1.0 - np.cos(np.pi / sides)) <= 0.01 < 0.33 * (1.0 - np.cos(np.pi / (sides - 1)))
    assert Detail(0.0).segments(20, 0.33) == 20
