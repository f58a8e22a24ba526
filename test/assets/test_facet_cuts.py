"""Polygons split along lines and cut to facets agree with shapely's intersections."""

import numpy as np
import pytest
import shapely

from simbev_ros.assets.mesh.clipping import Rings, split_along_lines, without_holes
from simbev_ros.assets.mesh.facet_cuts import cut_to_facets
from simbev_ros.assets.mesh.facets import Facets
from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.maps.land.membrane import Raster, node_positions_m
from simbev_ros.maps.region import Region

COMB = shapely.Polygon([(0, 0), (9, 0), (9, 6), (7, 6), (7, 2), (5, 2), (5, 6), (3, 6), (3, 2), (0, 4)])
HOLED = shapely.Point(300, 200).buffer(140).difference(shapely.MultiPoint([(260, 200), (333, 190)]).buffer(9.0))


def stars(count: int, rng: np.random.Generator) -> AnyArray:
    """Polygons with 3 to 30 corners, mostly not convex, around random points of the map."""
    found = []
    for corners in rng.integers(3, 31, count):
        angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, corners))
        around = rng.uniform(1.0, 8.0, (corners, 1)) * np.column_stack([np.cos(angle), np.sin(angle)])
        found.append(shapely.Polygon(around + rng.uniform(-4000.0, 4000.0, 2)))
    return np.array(found, object)[shapely.is_valid(found)]


def half(polygon: shapely.Polygon, line: Float64Array) -> shapely.Geometry:
    """The part of a polygon where a x + b y > c."""
    normal, along = line[:2], np.array([-line[1], line[0]])
    foot = np.array(polygon.centroid.coords[0])
    foot = foot - (foot @ normal - line[2]) * normal
    corners = [foot - 99 * along, foot + 99 * along, foot + 99 * (along + normal), foot + 99 * (normal - along)]
    return shapely.intersection(polygon, shapely.Polygon(corners))


def assert_split(polygons: AnyArray, lines: Float64Array) -> None:
    parts, origin, above = split_along_lines(Rings.from_polygons(polygons), lines)
    pieces = parts.polygons
    assert shapely.is_valid(pieces).all()
    assert (parts.area_m2 > -1e-9).all()
    for number, (polygon, line) in enumerate(zip(polygons, lines, strict=True)):
        for side, sign in ((True, 1.0), (False, -1.0)):
            found = shapely.union_all(pieces[(origin == number) & (above == side)])
            assert shapely.symmetric_difference(found, half(polygon, sign * line)).area < 1e-6
    starts, ends = parts.xy_m, parts.xy_m[parts.following]
    new = (
        shapely.distance(shapely.points((starts + ends) / 2.0), shapely.boundary(polygons[origin[parts.owner]])) > 1e-6
    )
    assert not (parts.is_cut & ~new & (np.hypot(*(ends - starts).T) > 1e-6)).any()


def test_random_polygons_are_split_as_shapely_splits_them() -> None:
    rng = np.random.default_rng(3)
    polygons = stars(300, rng)
    angle = rng.uniform(0.0, 2.0 * np.pi, len(polygons))
    normal = np.column_stack([np.cos(angle), np.sin(angle)])
    middle = shapely.get_coordinates(shapely.centroid(polygons)) + rng.uniform(-3.0, 3.0, (len(polygons), 2))
    assert_split(polygons, np.column_stack([normal, np.sum(normal * middle, axis=1)]))


@pytest.mark.parametrize("y_m", [0.0, 1.0, 2.0, 3.0, 4.0, 6.0])
@pytest.mark.parametrize("flip", [1.0, -1.0])
def test_lines_through_corners_and_along_sides(y_m: float, flip: float) -> None:
    assert_split(np.array([COMB], object), flip * np.array([[0.0, 1.0, y_m]]))
    assert_split(np.array([COMB], object), flip * np.array([[1.0, 0.0, y_m + 1.0]]))


def test_polygons_with_holes_are_cut_through_them() -> None:
    parts, origin = without_holes(np.array([COMB, HOLED], object))
    assert not shapely.get_num_interior_rings(parts).any()
    assert shapely.area(parts[origin == 1]).sum() == pytest.approx(HOLED.area)
    assert shapely.symmetric_difference(shapely.union_all(parts[origin == 1]), HOLED).area < 1e-6


def bumpy_facets(region: Region) -> Facets:
    """Facets of a bumpy surface, of all sizes."""
    low_m = np.array(region.area.bounds[:2]) - 64.0
    xy_m = node_positions_m(low_m, 2.0, (321, 321))
    away_m = np.linalg.norm(xy_m - low_m - [250.0, 330.0], axis=2)
    height_m = 20.0 * np.exp(-((away_m / 60.0) ** 2))
    return Facets.from_raster(Raster(low_m, 2.0, height_m), np.full(height_m.shape, 0.05))


def test_facets_cover_their_region_once() -> None:
    region = Region(-1, 2)
    facets = bumpy_facets(region)
    polygons = shapely.polygons(facets.corners_m)
    sizes = np.unique(np.round(np.log2(shapely.area(polygons))))
    assert len(sizes) >= 7
    assert shapely.area(polygons).sum() == pytest.approx(512.0**2)
    assert shapely.symmetric_difference(shapely.union_all(polygons), region.area).area < 1e-6


@pytest.mark.parametrize("make", [bumpy_facets, Facets.from_level_region])
def test_pieces_are_the_intersections_with_facets(make: type) -> None:
    region = Region(-1, 2)
    facets = make(region)
    polygons = shapely.polygons(facets.corners_m)
    area = shapely.transform(HOLED, lambda xy: xy + region.area.bounds[:2])
    cut = cut_to_facets(shapely.union(area, shapely.box(-90, 1100, 90, 1101)), facets)
    whole = shapely.intersection(shapely.union(area, shapely.box(-90, 1100, 90, 1101)), region.area)
    expected_m2 = shapely.area(shapely.intersection(polygons, whole))
    found_m2 = np.bincount(cut.facet, cut.pieces.area_m2, len(polygons))
    np.testing.assert_allclose(found_m2, expected_m2, atol=2e-6)
    inside = shapely.covers(shapely.buffer(polygons[cut.facet], 1e-6), cut.pieces.polygons)
    assert inside.all()
