import numpy as np
import pytest
import shapely

from simbev_ros.assets.buildings import STYLES, Plot
from simbev_ros.assets.furniture import bench, bus_shelter, fence, garden_wall, hydrant, litter_bin, street_light
from simbev_ros.assets.materials import Material, load_materials
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.primitives import Finish, box, cylinder, ellipsoid, extrusion, lathe, plate, tube
from simbev_ros.assets.signs import speed_sign
from simbev_ros.semantics import Tag

FINISH = Finish(Material.PLAIN, Tag.STATIC, (10, 20, 30))


def volume_m3(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles].astype(np.float64), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def is_closed(mesh: Mesh) -> bool:
    """Every directed edge has its reverse, equally often."""
    _, corner = np.unique(np.round(mesh.vertices.astype(np.float64), 4), axis=0, return_inverse=True)
    triangles = corner.reshape(-1)[mesh.triangles]
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    edges = edges[edges[:, 0] != edges[:, 1]]
    return sorted(map(tuple, edges.tolist())) == sorted(map(tuple, edges[:, ::-1].tolist()))


def faces_agree_with_normals(mesh: Mesh) -> bool:
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return bool((np.einsum("ti,tki->tk", faces, mesh.normals[mesh.triangles]) > -1e-6).all())


def prism_m3(sides: int, radius_m: float, height_m: float) -> float:
    return sides / 2.0 * radius_m**2 * np.sin(2.0 * np.pi / sides) * height_m


RING = shapely.box(0, 0, 4, 3).difference(shapely.box(1, 1, 2, 2))
SOLIDS = {
    "box": (box(FINISH, (1, 2, 3), (7, 8, 9)), 6.0),
    "bevelled box": (box(FINISH, (2, 2, 2), bevel_m=0.5), 8 - 12 * 0.125 * 1 - 8 * (0.125 - 0.125 / 6)),
    "cylinder": (cylinder(FINISH, (1, 2, 3), (1, 2, 7), 0.5, segments=10), prism_m3(10, 0.5, 4)),
    "slanted cone": (
        cylinder(FINISH, (0, 0, 0), (3, 4, 0), 0.5, end_radius_m=0.0, segments=9),
        prism_m3(9, 0.5, 5) / 3,
    ),
    "ring": (extrusion(FINISH, RING, -1.0, 2.0), 33.0),
    "lathe": (lathe(FINISH, np.array([[1, 0], [1, 2], [0, 5]]), segments=8), prism_m3(8, 1, 2) + prism_m3(8, 1, 3) / 3),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_closed_outward_and_of_the_analytic_volume(name: str) -> None:
    mesh, expected_m3 = SOLIDS[name]
    assert is_closed(mesh)
    assert faces_agree_with_normals(mesh)
    assert volume_m3(mesh) == pytest.approx(expected_m3, rel=1e-5)


def test_an_ellipsoids_volume_and_normals_converge_to_the_true_ones() -> None:
    mesh = ellipsoid(FINISH, (1, 2, 3), (4, 5, 6), segments=48, rings=32)
    assert volume_m3(mesh) == pytest.approx(4.0 / 3.0 * np.pi * 6.0, rel=0.01)
    gradient = (mesh.vertices - [4, 5, 6]) / np.square([1, 2, 3])
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    assert (np.einsum("ij,ij->i", gradient, mesh.normals) > 0.99).all()


def test_a_bent_tube_is_closed_and_keeps_its_radius() -> None:
    path = np.array([[0.0, 0, 0], [0, 0, 2], [1, 0, 3], [4, 0, 3]])
    mesh = tube(FINISH, path, 0.1, segments=12)
    assert is_closed(mesh)
    assert faces_agree_with_normals(mesh)
    line = shapely.LineString(path[:, [0, 2]])
    away = shapely.distance(line, shapely.points(mesh.vertices[:, [0, 2]].astype(np.float64)))
    assert away.max() < 0.101


def test_a_plate_covers_its_polygon_and_faces_up() -> None:
    mesh = plate(FINISH, RING, 1.5)
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] / 2.0
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(11.0)
    assert (mesh.vertices[:, 2] == 1.5).all()


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("wall", ["brick", "plaster", "glass"])
def test_buildings_are_closed_and_fill_their_plot(style: str, wall: str) -> None:
    for seed, height_m in enumerate((4.0, 9.0, 21.0, 45.0)):
        mesh = STYLES[style](Plot(15.0, 12.0, height_m), np.random.default_rng(seed), wall)
        assert is_closed(mesh)
        assert faces_agree_with_normals(mesh)
        assert volume_m3(mesh) > 15.0 * 12.0 * 2.5
        assert (mesh.tag == Tag.BUILDING).all()


@pytest.mark.parametrize("style", STYLES)
def test_windows_divide_every_wall_evenly(style: str) -> None:
    mesh = STYLES[style](Plot(18.0, 12.0, 20.0), np.random.default_rng(5), "plaster")
    for material in (Material.FACADE, Material.OFFICE_GLASS, Material.SHOPFRONT):
        corners = mesh.triangles[mesh.material[mesh.triangles[:, 0]] == material]
        spans = np.ptp(mesh.uv[corners], axis=1)
        np.testing.assert_allclose(spans / 3.0, np.round(spans / 3.0), atol=1e-5)
        assert (spans >= 3.0).all()


def test_furniture_is_closed() -> None:
    for mesh in (
        bench(),
        bus_shelter(),
        fence(5.0),
        garden_wall(4.0, (1, 2, 3)),
        hydrant(),
        litter_bin((1, 2, 3)),
        street_light(),
        speed_sign(30),
    ):
        assert is_closed(mesh)
        assert faces_agree_with_normals(mesh)


def test_every_material_has_plausible_properties() -> None:
    table = load_materials()
    for column in (table.roughness, table.metallic, table.specular, table.lidar_reflectance):
        assert column.shape == (len(Material),)
        assert ((column >= 0.0) & (column <= 1.0)).all()
    assert table.lidar_reflectance[Material.MARKING] > 3 * table.lidar_reflectance[Material.ASPHALT]
