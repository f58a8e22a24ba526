"""Objects beside the roads of OpenDRIVE files: positions and sizes worked by hand, repetitions, clear carriageways."""

from pathlib import Path

import numpy as np
import pytest
import shapely
from xodr_sample import LINE, geometry, lane, road, section, xodr

from simbev_ros.foundation.files.limits import MAX_OBJECT_COPIES
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Findings, sentences_of
from simbev_ros.maps.land_features import POINT_KINDS, Footprint, MapObject, ObjectKind
from simbev_ros.maps.object_clearance import clear_carriageways
from simbev_ros.maps.opendrive.importer import import_opendrive
from simbev_ros.maps.opendrive.reading.document import Document
from simbev_ros.maps.opendrive.reading.reader import read_document
from simbev_ros.maps.opendrive.roadside_objects import object_types, objects_of
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.safe_xml import parse

RADIUS_M = 80.0
ARC = f'<arc curvature="{1 / RADIUS_M!r}"/>'


def thing(attributes: str, inner: str = "", s: float = 50.0, t: float = -6.0) -> str:
    return f'<object id="1" s="{s}" t="{t}" {attributes}>{inner}</object>'


def document_of(tmp_path: Path, objects: str, plan: str = LINE, heading_rad: float = 0.0) -> tuple[Document, Findings]:
    """A road of 100 m from (10, 20), with a lane on its right side, and objects."""
    objects = f"<objects>{objects}</objects>"
    text = road(geometry(plan, 100.0, x=10.0, y=20.0, hdg=heading_rad), 100.0, section(lane(-1)), more=objects)
    path = tmp_path / "road.xodr"
    path.write_text(xodr(text))
    notes = Findings(path)
    return read_document(path, parse(path, "OpenDRIVE"), notes), notes


def read(
    tmp_path: Path, objects: str, plan: str = LINE, heading_rad: float = 0.0
) -> tuple[tuple[MapObject, ...], tuple[Footprint, ...], tuple[str, ...]]:
    document, notes = document_of(tmp_path, objects, plan, heading_rad)
    return *objects_of(document, notes), notes.sentences()


def corners(item: MapObject) -> Float64Array:
    assert item.is_outline
    return item.points_m[:-1]


def test_a_box_has_its_position_heading_and_size(tmp_path: Path) -> None:
    hdg = float(np.radians(30.0))
    size = f'length="4" width="2" height="3" zOffset="0.5" hdg="{hdg!r}"'
    # The road runs north (+y): s = 50, t = -6 is at x = 10 + 6, y = 20 + 50. The box's length points 30° left of that,
    # in the direction (-1/2, √3/2); its left is (-√3/2, -1/2).
    ((box,), _, _) = read(tmp_path, thing(f'type="barrier" {size}'), heading_rad=np.pi / 2)
    along, left = np.array([-0.5, 3**0.5 / 2]), np.array([-(3**0.5) / 2, -0.5])
    expected = [(16.0, 70.0) + u * along + v * left for u, v in ((2, 1), (-2, 1), (-2, -1), (2, -1))]
    assert corners(box)[:, :2] == pytest.approx(np.array(expected), abs=1e-9)
    assert (box.kind, box.height_m, box.bottom_m) == (ObjectKind.WALL, 3.0, 0.5)
    assert box.points_m[:, 2] == pytest.approx(0.0)


def test_a_pole_with_a_radius_is_a_circle(tmp_path: Path) -> None:
    ((pole,), _, _) = read(tmp_path, thing('type="pole" radius="0.25" height="5"'))
    assert np.hypot(*(corners(pole)[:, :2] - (60.0, 14.0)).T) == pytest.approx([0.25] * 16)
    assert (pole.kind, pole.height_m) == (ObjectKind.POLE, 5.0)


def test_an_outline_in_coordinates_of_the_object_or_of_the_road_becomes_a_building(tmp_path: Path) -> None:
    local = "".join(f'<cornerLocal u="{u}" v="{v}" z="0" height="9"/>' for u, v in ((0, 0), (8, 0), (8, -5), (0, -5)))
    along = "".join(
        f'<cornerRoad s="{s}" t="{t}" dz="0" height="7"/>' for s, t in ((20, 5), (30, 5), (30, 12), (20, 12))
    )
    outlines = f"<outlines><outline>{local}</outline></outlines>", f"<outline>{along}</outline>"
    _, buildings, _ = read(tmp_path, "".join(thing('type="building"', outline) for outline in outlines))
    assert buildings[0].outline.equals(shapely.box(60, 9, 68, 14)) and buildings[0].height_m == 9.0
    assert buildings[1].outline.equals(shapely.box(30, 25, 40, 32)) and buildings[1].height_m == 7.0


def test_copies_follow_a_curve_at_their_distance(tmp_path: Path) -> None:
    repeat = '<repeat s="10" length="60" distance="20" tStart="-4" tEnd="-10" heightStart="4" heightEnd="7"/>'
    (trees, _, _) = read(tmp_path, thing('type="tree" height="5"', repeat), plan=ARC)
    # The arc turns left about (10, 20 + R): a point at s and t has the radius R - t and the angle s / R - 90°.
    s_m, t_m = np.array([10.0, 30.0, 50.0, 70.0]), np.array([-4.0, -6.0, -8.0, -10.0])
    turn_rad = s_m / RADIUS_M - np.pi / 2
    expected = np.column_stack([np.cos(turn_rad), np.sin(turn_rad)]) * (RADIUS_M - t_m)[:, None] + (10, 20 + RADIUS_M)
    assert np.stack([tree.points_m[0, :2] for tree in trees]) == pytest.approx(expected, abs=1e-6)
    assert [tree.height_m for tree in trees] == pytest.approx([4.0, 5.0, 6.0, 7.0])


def test_an_object_repeated_without_gaps_is_a_band_along_the_road(tmp_path: Path) -> None:
    repeat = '<repeat s="0" length="90" distance="0" tStart="-8" tEnd="-8" widthStart="0.5" widthEnd="0.5"/>'
    (walls, _, _) = read(tmp_path, thing('type="soundBarrier" height="3"', repeat), plan=ARC)
    outlines = [shapely.Polygon(wall.points_m[:, :2]) for wall in walls]
    center = shapely.Point(10, 20 + RADIUS_M)
    ring = center.buffer(RADIUS_M + 8.26, quad_segs=256).difference(center.buffer(RADIUS_M + 7.73, quad_segs=256))
    assert all(outline.is_valid and ring.contains(outline) for outline in outlines)
    # Sector of the ring between R + 7.75 and R + 8.25 with the angle 90 / R.
    assert shapely.union_all(outlines).area == pytest.approx(90.0 / RADIUS_M * 0.5 * (RADIUS_M + 8.0), rel=1e-3)
    assert {wall.height_m for wall in walls} == {3.0}


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (thing('type="barrier" length="nan"'), "length='nan' is not a finite number"),
        (thing('type="tree"', t=1e6), "it is more than 500 m from its road"),
        (thing('type="pole" height="5000"'), "it is larger than 1000 m"),
        (thing('type="tree"', '<repeat s="0" length="100" distance="1e-9"/>'), f"more than {MAX_OBJECT_COPIES} copies"),
        (thing('type="barrier"', "<outline/>"), "its outline has fewer than 3 corners"),
    ],
)
def test_a_bad_object_is_left_out_with_a_note_and_the_others_stay(tmp_path: Path, bad: str, reason: str) -> None:
    objects, _, notes = read(tmp_path, bad + thing('type="tree"') + thing('type="car" length="4"'))
    assert [item.kind for item in objects] == [ObjectKind.TREE]
    assert len(notes) == 1 and "an object that cannot be read is left out" in notes[0] and reason in notes[0]


def layout(*levels: float) -> Layout:
    """A carriageway from x = 0 to 100 and y = -4 to 4 on each level, at these heights."""
    ends = [np.array([[0.0, y, z], [100.0, y, z]]) for z in levels for y in (4.0, -4.0)]
    strips = [
        Strip(str(k), str(k), LaneKind.DRIVING, ends[2 * k], ends[2 * k + 1], level=k) for k in range(len(levels))
    ]
    return Layout(tuple(strips), (), (), ())


def at(kind: ObjectKind, *points: tuple[float, ...], height_m: float = 1.0, bottom_m: float = 0.0) -> MapObject:
    return MapObject(kind, np.array([(*point, 0.0)[:3] for point in points]), height_m, bottom_m)


def test_nothing_stands_on_a_carriageway() -> None:
    beside, on_rim, in_middle = at(ObjectKind.TREE, (50, 6)), at(ObjectKind.TREE, (50, 3)), at(ObjectKind.POLE, (20, 0))
    box = at(ObjectKind.WALL, (60, 3.5), (62, 3.5), (62, 6.5), (60, 6.5), (60, 3.5))
    fence, gantry = at(ObjectKind.FENCE, (70, -9), (70, 9)), at(ObjectKind.POLE, (80, 0), bottom_m=5.0)
    kept, notes = clear_carriageways([beside, on_rim, in_middle, box, fence, gantry], layout(0.0))
    assert kept[0] is beside and kept[-1] is gantry
    assert kept[1].points_m[0] == pytest.approx((50.0, 4.5, 0.0))
    assert kept[2].points_m[0, :2] == pytest.approx((20.0, 4.5)) or kept[2].points_m[0, 1] == pytest.approx(-4.5)
    assert shapely.Polygon(kept[3].points_m[:, :2]).equals(shapely.box(60, 4, 62, 6.5))
    assert [shapely.LineString(part.points_m[:, :2]).length for part in kept[4:6]] == pytest.approx([5.0, 5.0])
    assert sentences_of("", notes) == ("an object on a carriageway is moved to its edge, or cut (4 times)",)


def test_what_stands_under_a_bridge_stays_and_what_lies_on_the_road_is_left_out() -> None:
    under, deck_wall = at(ObjectKind.BENCH, (50, 5)), at(ObjectKind.OBSTACLE, (1, 0), (3, 0), (3, 2), (1, 2), (1, 0))
    high = Layout((layout(0.0).strips[0], *(s for s in layout(0.0, 7.0).strips if s.level)), (), (), ())
    kept, notes = clear_carriageways([under, deck_wall], high)
    assert kept == (under,)
    assert sentences_of("", notes) == ("an object that stands on a carriageway is left out",)


def test_the_importer_reads_objects_and_leaves_out_buildings_on_the_road(tmp_path: Path) -> None:
    size = 'length="10" width="6" height="8"'
    objects = thing(f'type="building" {size}', t=-12.0) + thing(f'type="building" {size}', t=-3.0)
    document_of(tmp_path, objects + thing('type="streetLamp" height="8"', t=-4.5))
    work = tmp_path / "work"
    work.mkdir()
    parts = import_opendrive(tmp_path / "road.xodr", work)
    (building,) = parts.features.buildings or ()
    assert building.outline.area == pytest.approx(60.0) and building.height_m == 8.0
    assert [item.kind for item in parts.features.objects] == [ObjectKind.STREET_LAMP]
    assert any(
        "a building that stands on a carriageway is left out" in note
        for note in sentences_of("sample.xodr", parts.findings)
    )


def test_every_kind_of_object_can_be_repeated_without_gaps(tmp_path: Path) -> None:
    repeat = '<repeat s="0" length="30" distance="0" tStart="-8" tEnd="-8"/>'
    for name, kind in object_types().items():
        main, _, subtype = name.partition("/")
        objects, buildings, notes = read(tmp_path, thing(f'type="{main}" subtype="{subtype}"', repeat))
        if kind.kind in POINT_KINDS:
            assert [item.points_m[0, :2].tolist() for item in objects] == [[60.0, 14.0]], name
        else:
            assert (len(objects) > 1 and all(item.is_outline for item in objects)) or len(buildings) > 1, name
        assert notes == ()
