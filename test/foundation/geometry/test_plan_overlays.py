"""Overlays of geometry that GEOS accepts are GEOS's; of other geometry they have the areas worked by hand."""

import ast
from pathlib import Path

import numpy as np
import pytest
import shapely
from shapely import GeometryCollection, LineString, MultiPolygon, Polygon

from simbev_ros.foundation.geometry import overlay

SQUARE = shapely.box(0.0, 0.0, 4.0, 4.0)
BOW_TIE = Polygon([(0, 0), (4, 4), (4, 0), (0, 4)])
"""Two triangles of 4 m² that touch at (2, 2), left and right."""
MIXED = GeometryCollection([shapely.box(2.0, 0.0, 6.0, 4.0), LineString([(0, 1), (9, 1)])])
"""A square of 16 m² and a line."""
OVERLAPPING = MultiPolygon([shapely.box(0.0, 0.0, 2.0, 4.0), shapely.box(1.0, 0.0, 3.0, 4.0)])
"""An invalid multipolygon that covers 12 m²."""


def test_valid_geometry_gives_the_results_of_shapely() -> None:
    rng = np.random.default_rng(3)
    corners_m = rng.uniform(-5.0, 5.0, (60, 5, 2))
    areas = shapely.convex_hull(shapely.multipoints(corners_m.reshape(-1, 2), indices=np.repeat(np.arange(60), 5)))
    for name in ("intersection", "difference", "union"):
        found, expected = (getattr(library, name)(areas[:30], areas[30:]) for library in (overlay, shapely))
        assert shapely.equals_exact(found, expected).all()
    assert overlay.union_all(areas).equals_exact(shapely.union_all(areas), 0.0)


@pytest.mark.parametrize(
    ("operation", "a", "b", "area_m2"),
    [
        ("intersection", SQUARE, MIXED, 8.0),
        ("difference", MIXED, SQUARE, 8.0),
        ("union", MIXED, SQUARE, 24.0),
        ("difference", SQUARE, BOW_TIE, 8.0),
        ("intersection", BOW_TIE, shapely.box(0.0, 0.0, 2.0, 4.0), 4.0),
        ("union", BOW_TIE, shapely.box(1.0, -1.0, 3.0, 5.0), 8.0 + 12.0 - 2.0),
        ("difference", SQUARE, OVERLAPPING, 4.0),
    ],
)
def test_what_geos_rejects_or_miscounts_has_the_area_of_the_repaired_geometry(
    operation: str, a: shapely.Geometry, b: shapely.Geometry, area_m2: float
) -> None:
    found = getattr(overlay, operation)(a, b)
    assert found.is_valid
    assert found.area == pytest.approx(area_m2, abs=1e-4)


def test_an_array_is_repaired_only_where_it_has_to_be() -> None:
    found = overlay.intersection(np.array([SQUARE, MIXED]), shapely.box(3.0, 0.0, 9.0, 2.0))
    assert shapely.area(found).tolist() == pytest.approx([2.0, 6.0])


def test_many_areas_of_which_one_is_mixed_are_merged() -> None:
    assert overlay.union_all([SQUARE, MIXED, BOW_TIE]).area == pytest.approx(24.0, abs=1e-4)


def test_repaired_geometry_keeps_what_has_the_highest_dimension() -> None:
    assert overlay.repair(MIXED).equals(shapely.box(2.0, 0.0, 6.0, 4.0))
    assert overlay.repair(BOW_TIE).area == pytest.approx(8.0)
    assert overlay.repair(SQUARE) is SQUARE
    assert overlay.repair(Polygon()).is_empty


def test_every_overlay_of_the_package_goes_through_the_module() -> None:
    direct = {"union", "union_all", "difference", "intersection", "symmetric_difference", "unary_union"}
    package = Path(overlay.__file__).parents[2]
    found = [
        f"{path.relative_to(package)}:{node.lineno}"
        for path in sorted(package.rglob("*.py"))
        if path != Path(overlay.__file__)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "shapely"
        and node.attr in direct
    ]
    assert found == []


def test_an_area_does_not_turn_inside_out() -> None:
    # Its outline crosses itself by 2e-15 m: GEOS 3.14 returns the half-plane without the area, 137,000 m².
    area = Polygon(
        [
            *((0.0, 0.0), (3.019843298865725, 0.0), (1.578035270988413, 0.6243434019163642)),
            *((11.404085647445958, 23.315827401936588), (26.854, 0.0), (5.649637368602871, 32.0)),
            *((5.649637368602873, 32.0), (9.822370883730388, 25.7028301767313), (0.0, 3.019843298865725)),
        ]
    )
    near_m, far_m = 185.21811110415987, 370.43622220831975
    above = Polygon([(near_m, near_m), (-near_m, -near_m), (-far_m, 0.0), (0.0, far_m)])
    below = Polygon([(-near_m, -near_m), (near_m, near_m), (far_m, 0.0), (0.0, -far_m)])
    parts = overlay.intersection(np.array([area, SQUARE, area], object), np.array([above, above, below], object))
    assert shapely.area(parts) == pytest.approx([60.61, 8.0, 2.05], abs=0.02)  # by counting points
    assert overlay.intersection(area, above).area == pytest.approx(60.61, abs=0.02)
