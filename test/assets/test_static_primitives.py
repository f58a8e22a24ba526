import numpy as np
import pytest
import shapely

from simbev_ros.assets.architecture.kinds import build, load_kinds
from simbev_ros.assets.architecture.outlines import building_on_outline
from simbev_ros.assets.architecture.plot import Plot
from simbev_ros.assets.architecture.walls import draw_wall
from simbev_ros.assets.materials import Material, load_materials
from simbev_ros.assets.mesh.graded import GradedMesh
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box, boxes, cylinder, ellipsoid, extrusion, lathe, plate, tube
from simbev_ros.assets.street.barriers import PANEL_M, panel
from simbev_ros.assets.street.furniture import bench, bicycle_rack, bus_shelter, cabinet, hydrant, litter_bin, mailbox
from simbev_ros.assets.street.poles import mast, street_light, utility_pole
from simbev_ros.assets.street.signs import speed_sign, stop_sign, street_name_sign, yield_sign
from simbev_ros.assets.street.yard_things import container, dumpster, hay_bale, pallets, trailer, wheelie_bin, wood_pile
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.land_features import Footprint

STYLES = ("brick", "plaster", "timber", "concrete", "metal", "glass")

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


WINDOWED = [
    Material.FACADE,
    Material.BRICK_FACADE,
    Material.TIMBER_FACADE,
    Material.CONCRETE_FACADE,
    Material.METAL_FACADE,
    Material.OFFICE_GLASS,
    Material.SHOPFRONT,
]
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


def test_many_boxes_are_the_same_as_one_by_one() -> None:
    sizes_m, centers_m = np.array([[1.0, 2, 3], [4, 5, 6]]), np.array([[0.0, 0, 0], [9, 8, 7]])
    together = boxes(FINISH, sizes_m, centers_m)
    alone = Mesh.merge(
        [box(FINISH, tuple(size), tuple(center)) for size, center in zip(sizes_m, centers_m, strict=True)]
    )
    assert is_closed(together)
    assert volume_m3(together) == pytest.approx(6.0 + 120.0)
    np.testing.assert_array_equal(together.vertices[together.triangles], alone.vertices[alone.triangles])


def test_copies_are_what_transforming_one_by_one_gives() -> None:
    mesh = cylinder(FINISH, (0, 0, 0), (0.3, 0.2, 1.0), 0.4)
    turn = np.radians(30.0)
    turned = np.array(
        [[np.cos(turn), -np.sin(turn), 0, 4], [np.sin(turn), np.cos(turn), 0, 5], [0, 0, 1, 6], [0, 0, 0, 1]]
    )
    mirrored = np.diag([-2.0, 2.0, 2.0, 1.0])
    copies = mesh.copies(np.stack([turned, mirrored]), tint=np.array([[1.0, 1, 1], [0.5, 2.0, 100.0]]))
    for copy, pose in zip(copies, (turned, mirrored), strict=True):
        expected = mesh.transform(pose)
        np.testing.assert_allclose(copy.vertices, expected.vertices, atol=1e-5)
        np.testing.assert_allclose(copy.normals, expected.normals, atol=1e-5)
        assert faces_agree_with_normals(copy)
    assert copies[1].color[0].tolist() == [5, 40, 255]


@pytest.mark.parametrize("name", load_kinds())
def test_buildings_of_every_kind_are_closed_and_reach_from_their_foundation_to_their_eaves(name: str) -> None:
    kind = load_kinds()[name]
    for seed, style in enumerate(STYLES):
        rng = np.random.default_rng(seed)
        bays = rng.integers(*kind.width, endpoint=True), rng.integers(*kind.depth, endpoint=True)
        height_m = rng.uniform(*(kind.height_m or (5.0, 45.0)))
        plot = Plot(3.0 * bays[0], 3.0 * bays[1], height_m, foundation_m=1.5)
        mesh = build(name, plot, kind.draw_wall(style, rng), rng)
        assert is_closed(mesh)
        assert faces_agree_with_normals(mesh)
        assert (mesh.tag == Tag.BUILDING).all()
        low_m, high_m = mesh.bounds_m
        assert low_m[2] == pytest.approx(-1.5)
        assert high_m[2] > 0.9 * min(height_m, 8.0)
        assert max(-low_m[0], high_m[0]) < plot.width_m / 2.0 + kind.verge_m + 1e-4
        assert low_m[1] > -kind.front_m - 1e-4
        assert high_m[1] < plot.depth_m + 0.6 + 1e-4


@pytest.mark.parametrize("style", STYLES)
def test_windows_divide_every_wall_evenly(style: str) -> None:
    rng = np.random.default_rng(5)
    for name in ("town_house", "apartments", "office", "shop", "lecture_block"):
        mesh = build(name, Plot(18.0, 12.0, 20.0), draw_wall(style, rng), rng)
        walls = mesh.triangles[np.isin(mesh.material[mesh.triangles[:, 0]], WINDOWED)]
        uv = mesh.uv[walls]
        spans = np.ptp(uv[uv.min(axis=(1, 2)) >= 0.0], axis=1)
        assert len(spans) > 0
        np.testing.assert_allclose(spans / 3.0, np.round(spans / 3.0), atol=1e-5)
        assert (spans >= 3.0).all()


COURT = shapely.box(0, 0, 40, 30).difference(shapely.box(10, 8, 28, 20))


@pytest.mark.parametrize("outline", [COURT, shapely.box(0, 0, 12, 9), shapely.Point(0, 0).buffer(15, quad_segs=3)])
def test_a_prescribed_building_fills_its_outline_to_its_height(outline: shapely.Polygon) -> None:
    rng = np.random.default_rng(1)
    mesh = building_on_outline(Footprint(outline, 12.0), 0.8, draw_wall("brick", rng), rng)
    assert is_closed(mesh)
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    plan = shapely.union_all([shapely.Polygon(triangle[:, :2]).buffer(1e-6) for triangle in corners])
    assert plan.buffer(1e-3).covers(outline)
    assert outline.buffer(0.5, join_style="mitre").covers(plan)  # steps, eaves
    assert mesh.bounds_m[0, 2] == pytest.approx(-0.8)
    assert mesh.bounds_m[1, 2] == pytest.approx(12.0, abs=0.9)


def test_furniture_is_closed() -> None:
    color = (1, 2, 3)
    street = [bench(), bus_shelter(), hydrant(), litter_bin(color), mailbox(), cabinet(), bicycle_rack()]
    poles = [street_light(), mast(), utility_pole()]
    signs = [speed_sign(30), speed_sign(120), stop_sign(), yield_sign(), street_name_sign(color)]
    yard = [trailer(color), container(color), dumpster(color), wheelie_bin(color), pallets(), hay_bale(), wood_pile()]
    panels = [panel(kind, 0) for kind in PANEL_M]
    for thing in (*street, *poles, *signs, *yard, *panels):
        mesh = thing.mesh if isinstance(thing, GradedMesh) else thing
        assert is_closed(mesh)
        assert faces_agree_with_normals(mesh)


def test_every_material_has_plausible_properties() -> None:
    table = load_materials()
    for column in (table.roughness, table.metallic, table.specular, table.lidar_reflectance):
        assert column.shape == (len(Material),)
        assert ((column >= 0.0) & (column <= 1.0)).all()
    assert table.lidar_reflectance[Material.MARKING] > 3 * table.lidar_reflectance[Material.ASPHALT]
