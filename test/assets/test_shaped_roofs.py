"""Roofs of prescribed shapes: volumes worked by hand or integrated by brute force, directions, and heights."""

import numpy as np
import pytest
import shapely

from simbev_ros.assets.architecture.outlines import building_on_outline
from simbev_ros.assets.architecture.shaped_roofs import fits_roof, roof_shapes, shaped_roof, slope_across
from simbev_ros.assets.architecture.walls import Wall
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import triangulate
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land_features import Footprint

WALL = Wall("brick", Material.BRICK_FACADE, (140, 74, 56))
HOUSE = shapely.box(-6.0, -4.0, 6.0, 4.0)
EAVES_M, RISE_M = 5.0, 3.0


def roof(plan: shapely.Polygon, name: str, slope_rad: float | None = None) -> Mesh:
    slope_rad = slope_across(plan) if slope_rad is None else slope_rad
    return shaped_roof(plan, name, EAVES_M, RISE_M, slope_rad, (90, 60, 50), WALL)


def volume_m3(mesh: Mesh, plan: shapely.Polygon) -> float:
    """Volume between ceiling and roof by the divergence theorem; wrong if the roof has gaps or flipped faces."""
    corners_m = mesh.vertices[mesh.triangles].astype(float) - [0.0, 0.0, EAVES_M]
    flat, faces = triangulate(plan)
    floor_m = np.column_stack([flat, np.zeros(len(flat))])[faces[:, ::-1]]
    a, b, c = np.concatenate([corners_m, floor_m]).swapaxes(0, 1)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


@pytest.mark.parametrize(
    ("name", "share"),
    [
        ("gabled", 1 / 2),
        ("skillion", 1 / 2),
        ("saltbox", 1 / 2),
        ("gambrel", 0.22 * 0.64 + 0.28 * 1.64),
        ("pyramidal", 1 / 3),
        ("mansard", 0.8 * (1 + 0.85 + 0.85**2) / 3 + 0.2 * 0.85**2 / 3),
    ],
)
def test_a_roof_encloses_the_volume_of_its_shape(name: str, share: float) -> None:
    assert volume_m3(roof(HOUSE, name), HOUSE) == pytest.approx(12.0 * 8.0 * RISE_M * share, rel=1e-4)


def test_a_dome_on_a_circle_is_half_an_ellipsoid() -> None:
    circle = shapely.Point(30.0, -20.0).buffer(4.0, quad_segs=32)
    assert volume_m3(roof(circle, "dome"), circle) == pytest.approx(2 / 3 * np.pi * 16.0 * RISE_M, rel=0.02)


def test_the_ridge_runs_along_the_house_or_across_its_slope() -> None:
    for slope_rad, ridge_axis in ((slope_across(HOUSE), 0), (0.0, 1)):
        mesh = roof(HOUSE, "gabled", slope_rad)
        top_m = mesh.vertices[mesh.vertices[:, 2] > EAVES_M + RISE_M - 1e-3]
        assert np.ptp(top_m[:, ridge_axis]) == pytest.approx((12.0, 8.0)[ridge_axis], abs=1e-3)
        assert np.ptp(top_m[:, 1 - ridge_axis]) == pytest.approx(0.0, abs=1e-3)


def test_a_skillion_roof_falls_in_its_direction() -> None:
    mesh = roof(HOUSE, "skillion", np.radians(0.0))  # falls toward +x
    assert mesh.vertices[np.abs(mesh.vertices[:, 0] + 6.0) < 1e-3, 2].max() == pytest.approx(EAVES_M + RISE_M)
    assert mesh.vertices[np.abs(mesh.vertices[:, 0] - 6.0) < 1e-3, 2].max() == pytest.approx(EAVES_M)


def test_a_gabled_roof_on_an_l_has_the_volume_below_its_slopes() -> None:
    wings = shapely.Polygon([(0, 0), (14, 0), (14, 5), (6, 5), (6, 11), (0, 11)])
    plan = shapely.difference(wings, shapely.box(2, 2, 3, 3))
    slope_rad = slope_across(plan)
    xy_m = np.stack(np.meshgrid(np.arange(0.01, 14, 0.02), np.arange(0.01, 11, 0.02)), axis=-1).reshape(-1, 2)
    xy_m = xy_m[shapely.contains_xy(plan, xy_m)]
    reach_m = shapely.get_coordinates(plan) @ [np.cos(slope_rad), np.sin(slope_rad)]
    share = (xy_m @ [np.cos(slope_rad), np.sin(slope_rad)] - reach_m.min()) / np.ptp(reach_m)
    heights_m: Float64Array = RISE_M * (1.0 - np.abs(2.0 * share - 1.0))
    assert volume_m3(roof(plan, "gabled", slope_rad), plan) == pytest.approx(heights_m.sum() * 0.02**2, rel=2e-3)


def test_a_roof_to_a_point_needs_a_compact_outline() -> None:
    ell = shapely.Polygon([(0, 0), (14, 0), (14, 4), (4, 4), (4, 14), (0, 14)])
    assert fits_roof(HOUSE, "pyramidal") and not fits_roof(ell, "pyramidal") and fits_roof(ell, "gabled")
    assert not fits_roof(HOUSE, "crosspitched")


@pytest.mark.parametrize("name", ["flat", "hipped", "crosspitched", *roof_shapes()])
@pytest.mark.parametrize("bottom_m", [0.0, 6.0])
def test_a_building_reaches_from_its_underside_to_its_height(name: str, bottom_m: float) -> None:
    building = Footprint(HOUSE, 11.0, roof=name, bottom_m=bottom_m, roof_height_m=2.5, roof_color=0x8A4B3A)
    mesh = building_on_outline(building, 0.5, WALL, np.random.default_rng(1))
    extra_m = {"hipped": 0.6, "flat": 0.65, "crosspitched": 0.65}.get(name, 1e-3)  # thickness and overhang, parapet
    assert 0.0 <= mesh.bounds_m[1, 2] - 11.0 + 1e-4 <= extra_m
    assert mesh.bounds_m[0, 2] == pytest.approx(bottom_m or -0.5)
    tiles = mesh.color[mesh.material == Material.ROOF]
    assert (tiles == (0x8A, 0x4B, 0x3A)).all() and len(tiles)
