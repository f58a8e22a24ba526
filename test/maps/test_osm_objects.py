"""Objects of OpenStreetMap files: which tags make which object, where, and what is left out."""

import numpy as np
import pytest
import shapely

from simbev_ros.maps.land_features import MapObject, ObjectKind
from simbev_ros.maps.osm.areas import areas_of
from simbev_ros.maps.osm.data import OsmData, Tags, Way
from simbev_ros.maps.osm.objects import objects_of

EXTENT = shapely.box(-100, -100, 100, 100)


def read(
    nodes: list[tuple[tuple[float, float], Tags]], ways: list[tuple[tuple[int, ...], Tags]] | None = None
) -> tuple[tuple[MapObject, ...], tuple[str, ...]]:
    xy_m = np.array([position for position, _ in nodes])
    tags = {number: tags for number, (_, tags) in enumerate(nodes) if tags}
    lines = tuple(Way(str(k), line, way_tags) for k, (line, way_tags) in enumerate(ways or []))
    data = OsmData(xy_m, tags, lines, (), ())
    return objects_of(data, xy_m, areas_of(data, xy_m), EXTENT)


@pytest.mark.parametrize(
    ("tags", "kind"),
    [
        ({"natural": "tree"}, ObjectKind.TREE),
        ({"natural": "tree", "leaf_type": "needleleaved"}, ObjectKind.CONIFER),
        ({"highway": "street_lamp"}, ObjectKind.STREET_LAMP),
        ({"amenity": "bench"}, ObjectKind.BENCH),
        ({"amenity": "waste_basket"}, ObjectKind.BIN),
        ({"highway": "bus_stop", "shelter": "yes"}, ObjectKind.BUS_SHELTER),
        ({"highway": "bus_stop"}, None),
        ({"emergency": "fire_hydrant"}, ObjectKind.HYDRANT),
        ({"emergency": "fire_hydrant", "fire_hydrant:type": "underground"}, None),
        ({"barrier": "bollard"}, ObjectKind.POLE),
        ({"power": "pole"}, ObjectKind.UTILITY_POLE),
        ({"barrier": "gate"}, None),
    ],
)
def test_a_node_becomes_the_object_of_its_tags(tags: Tags, kind: ObjectKind | None) -> None:
    objects, notes = read([((10.0, 20.0), tags)])
    assert [item.kind for item in objects] == ([] if kind is None else [kind]) and notes == ()
    for item in objects:
        assert item.points_m[:, :2].mean(axis=0) == pytest.approx((10.0, 20.0), abs=0.02)


def test_heights_and_directions_are_read() -> None:
    ((tree, bench), _) = read(
        [((0, 0), {"natural": "tree", "height": "40 ft"}), ((5, 0), {"amenity": "bench", "direction": "S"})]
    )
    assert tree.height_m == pytest.approx(12.192) and np.isnan(tree.yaw_rad)
    assert bench.yaw_rad == pytest.approx(np.radians(-90.0))


def test_a_bollard_is_a_post_of_its_diameter() -> None:
    ((bollard,), _) = read([((0, 0), {"barrier": "bollard", "height": "1.2"})])
    assert bollard.is_outline and bollard.height_m == 1.2
    assert np.hypot(*bollard.points_m[:, :2].T) == pytest.approx([0.075] * 9)


def test_barriers_are_lines_and_closed_ones_are_not_filled() -> None:
    corners = [((x, y), {}) for x, y in ((0, 0), (20, 0), (20, 20), (0, 20))]
    ((wall,), _) = read(corners, [((0, 1, 2), {"barrier": "wall", "height": "2"})])
    assert wall.kind is ObjectKind.WALL and not wall.is_outline and wall.points_m[:, :2].tolist()[1] == [20, 0]
    fences, _ = read(corners, [((0, 1, 2, 3, 0), {"barrier": "fence"})])
    assert not any(fence.is_outline for fence in fences)
    assert sum(shapely.LineString(fence.points_m[:, :2]).length for fence in fences) == 80.0
    ((hedge,), _) = read(corners, [((0, 1, 2, 3, 0), {"barrier": "hedge", "area": "yes"})])
    assert hedge.is_outline
    rails, _ = read(corners, [((0, 1, 2, 3, 0), {"railway": "rail", "area": "yes"})])
    assert not any(part.is_outline for part in rails)


def test_a_tree_row_has_a_tree_every_eight_meters_unless_its_nodes_are_trees() -> None:
    row = [((0, 1), {"natural": "tree_row"})]
    trees, _ = read([((0, 0), {}), ((30, 0), {})], row)
    assert [tree.points_m[0, 0] for tree in trees] == [0.0, 8.0, 16.0, 24.0]
    trees, _ = read([((0, 0), {"natural": "tree"}), ((30, 0), {"natural": "tree"})], row)
    assert [tree.points_m[0, 0] for tree in trees] == [0.0, 30.0]


def test_a_power_line_has_its_poles_once() -> None:
    poles = [((x, 0), {"power": "pole"}) for x in (0, 40, 80)]
    ((line,), _) = read(poles, [((0, 1, 2), {"power": "minor_line"})])
    assert line.kind is ObjectKind.UTILITY_POLE and len(line.points_m) == 3


def test_rails_on_bridges_and_in_tunnels_are_left_out_with_a_note() -> None:
    nodes = [((0, 0), {}), ((50, 0), {})]
    kinds = [{}, {"bridge": "yes"}, {"tunnel": "yes"}, {"layer": "-1"}]
    objects, notes = read(nodes, [((0, 1), {"railway": "rail", **more}) for more in kinds])
    assert [item.kind for item in objects] == [ObjectKind.RAILS]
    assert [(each.rule, each.count) for each in notes] == [("a railway on a bridge or in a tunnel is left out", 3)]


def test_objects_far_from_the_roads_are_left_out() -> None:
    far = {"natural": "tree"}
    objects, _ = read([((500, 0), far), ((500, 50), {})], [((0, 1), {"barrier": "fence"})])
    assert objects == ()


def test_objects_beyond_the_limit_are_left_out_with_a_note(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("simbev_ros.maps.osm.objects.MAX_MAP_OBJECTS", 2)
    objects, notes = read([((x, 0), {"natural": "tree"}) for x in range(5)])
    assert len(objects) == 2 and [(each.rule, each.count) for each in notes] == [
        ("an object beyond the first 2 is left out", 3)
    ]


def test_lines_beyond_the_limit_are_left_out_with_a_note(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("simbev_ros.maps.osm.objects.MAX_OBJECT_LINES_KM", 0.1)
    nodes = [((0, 0), {}), ((70, 0), {})]
    objects, notes = read(nodes, [((0, 1), {"barrier": "wall"}), ((1, 0), {"barrier": "wall"})])
    assert len(objects) == 1 and [each.rule for each in notes] == [
        "a line of objects beyond the first 0.1 km is left out"
    ]


@pytest.mark.parametrize(
    ("tags", "kind"),
    [
        ({"amenity": "parking"}, ObjectKind.PARKING_LOT),
        ({"amenity": "parking_space"}, ObjectKind.PARKING_SPACE),
        ({"amenity": "parking", "parking": "underground"}, None),
        ({"amenity": "parking", "parking": "multi-storey"}, None),
    ],
)
def test_parking_on_the_ground_is_an_outline(tags: Tags, kind: ObjectKind | None) -> None:
    corners = [((x, y), {}) for x, y in ((0, 0), (20, 0), (20, 10), (0, 10))]
    objects, _ = read(corners, [((0, 1, 2, 3, 0), tags)])
    assert [item.kind for item in objects] == ([] if kind is None else [kind])
    assert all(shapely.Polygon(item.points_m[:, :2]).area == 200.0 for item in objects)
