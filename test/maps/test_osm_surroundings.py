"""What an OpenStreetMap file says about buildings and objects, hit by the lidar's rays in the built region."""

from pathlib import Path

import numpy as np
import pytest
from osm_sample import DATUM, Writer
from synthetic_world import world

from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.assets.regions.build import build_region
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.land_features import ObjectKind
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.osm.objects import object_rules
from simbev_ros.maps.region import regions_of
from simbev_ros.maps.source import map_spec
from simbev_ros.schema.scene.state import ACTOR_DTYPE
from simbev_ros.simulation.raycast.scene import RayScene


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> RoadNetwork:
    """A street along y = 0 with things on its northern side."""
    writer, folder = Writer(), tmp_path_factory.mktemp("things")
    writer.way([(-100, 0), (100, 0)], {"highway": "residential"})
    house = [(20, 12), (32, 12), (32, 20), (20, 20)]
    writer.ring(house, {"building": "house", "height": "9", "roof:height": "3", "roof:shape": "gabled"})
    tower = [(40, 10), (50, 10), (50, 20), (40, 20)]
    writer.ring(tower, {"building": "office", "height": "12"})
    writer.ring(tower, {"building:part": "yes", "height": "12", "min_height": "6"})
    writer.way([(-40, 12), (-20, 12)], {"barrier": "wall"})
    writer.way([(-70, 12), (-50, 12)], {"barrier": "hedge"})
    writer.way([(-100, 40), (100, 40)], {"railway": "rail"})
    writer.way([(-100, 1), (100, 1)], {"railway": "tram"})
    writer.ring([(-30, 15), (-10, 15), (-10, 25), (-30, 25)], {"amenity": "parking"})
    writer.ring([(-20, 18), (-17, 18), (-17, 23), (-20, 23)], {"amenity": "parking_space"})
    (folder / "things.osm").write_text(writer.text())
    return load_network(map_spec(str(folder / "things.osm")), folder)


@pytest.fixture(scope="module")
def rays(network: RoadNetwork) -> RayScene:
    terrain = Terrain(network)
    tiles = [tile for region in regions_of(network.layout) for tile in build_region(network, region, terrain).tiles]
    scene = RayScene(StaticScene(tuple(tiles), ()), ())
    scene.update(world(np.zeros(0, ACTOR_DTYPE)), np.zeros(3), 200.0)
    return scene


def cast(
    rays: RayScene, network: RoadNetwork, origin: tuple[float, float, float], direction: tuple[float, float, float]
) -> tuple[Tag, float]:
    """Tag and distance of the first hit from a position of the sample."""
    geodetic = DATUM.geodetic_from_map(np.array([*origin[:2], 0.0]))
    origin_m: Float64Array = np.array([[*network.datum.map_from_geodetic(*geodetic)[:2], origin[2]]])
    hits = rays.cast(origin_m, np.array([direction]))
    return Tag(hits.tag[0]), float(hits.range_m[0])


@pytest.fixture(scope="module")
def land_m(rays: RayScene, network: RoadNetwork) -> float:
    """Height of the land: a little below the street's crown, from which the street falls to its sides."""
    tag, range_m = cast(rays, network, (-80.0, 25.0, 5.0), DOWN)
    assert tag is Tag.TERRAIN
    return 5.0 - range_m


NORTH, DOWN = (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)


@pytest.mark.parametrize(
    ("x", "z", "tag", "range_m"),
    [
        (26.0, 5.0, Tag.BUILDING, 12.0),
        # The roof rises from 6 m at y = 12 to 9 m at y = 16: it is 8.5 m high at y = 12 + 4 · 2.5 / 3.
        (24.0, 8.5, Tag.BUILDING, 12.0 + 4.0 * 2.5 / 3.0),
        (45.0, 6.1, Tag.BUILDING, 10.0),
        (45.0, 11.5, Tag.BUILDING, 10.0),
        (-30.0, 1.0, Tag.WALL, 12.0 - 0.11),
        (-60.0, 0.6, Tag.VEGETATION, 12.0 - 0.4),
    ],
)
def test_buildings_and_barriers_are_hit_where_the_file_has_them(
    rays: RayScene, network: RoadNetwork, land_m: float, x: float, z: float, tag: Tag, range_m: float
) -> None:
    tolerance_m = 0.1 if tag is Tag.VEGETATION else 0.03
    assert cast(rays, network, (x, 0.0, land_m + z), NORTH) == (tag, pytest.approx(range_m, abs=tolerance_m))


@pytest.mark.parametrize(("x", "z"), [(24.0, 9.05), (45.0, 5.9), (45.0, 3.0)])
def test_rays_pass_above_a_roof_and_below_a_raised_part(
    rays: RayScene, network: RoadNetwork, land_m: float, x: float, z: float
) -> None:
    assert not cast(rays, network, (x, 0.0, land_m + z), NORTH)[1] < 20.0


def test_rails_lie_on_ballast_beside_streets_and_flush_within_them(
    rays: RayScene, network: RoadNetwork, land_m: float
) -> None:
    half_gauge_m = 1.435 / 2.0
    assert cast(rays, network, (5.0, 40.0 + half_gauge_m, 5.0), DOWN) == (
        Tag.RAIL_TRACK,
        pytest.approx(5.0 - land_m - 0.16, abs=5e-3),
    )
    tag, range_m = cast(rays, network, (5.0, 40.0, 5.0), DOWN)
    assert tag is Tag.RAIL_TRACK and 5.0 - land_m - 0.1 < range_m < 5.0 - land_m
    for side, expected in ((0.0, Tag.ROAD), (half_gauge_m, Tag.RAIL_TRACK)):
        tag, range_m = cast(rays, network, (5.0, 1.0 + side, 5.0), DOWN)
        assert tag is expected and range_m == pytest.approx(5.0, abs=0.05)


def test_a_parking_lot_is_paved_and_its_spaces_have_lines(rays: RayScene, network: RoadNetwork) -> None:
    grass, lot, line, space = (cast(rays, network, (x, 20.0, 5.0), DOWN) for x in (-31.0, -25.0, -19.95, -18.5))
    assert [tag for tag, _ in (grass, lot, line, space)] == [Tag.TERRAIN, Tag.GROUND, Tag.GROUND, Tag.GROUND]
    rises_m = [grass[1] - range_m for _, range_m in (lot, line, space)]
    assert rises_m == pytest.approx([0.016, 0.02, 0.016], abs=1e-3)


def test_every_object_of_the_table_is_built(tmp_path: Path) -> None:
    writer, rules = Writer(), object_rules()
    writer.way([(-100, 0), (100, 0)], {"highway": "residential"})
    for row, key in enumerate(rules.lines):
        name, _, value = key.rpartition("=")
        for more in ({}, {"area": "yes"}):
            x, y = -90 + 12 * row, 15 + 20 * len(more)
            writer.ring([(x, y), (x + 10, y), (x + 10, y + 10), (x, y + 10)], {name: value, **more})
    text = writer.text()
    for row, key in enumerate([*rules.points, *rules.posts]):
        name, _, value = key.rpartition("=")
        tags = {name: value} | {k: v[0] for k, v in rules.required.get(key, {}).items()}
        latitude, longitude, _ = DATUM.geodetic_from_map(np.array([-90.0 + 8.0 * row, -15.0, 0.0]))
        inner = "".join(f'<tag k="{k}" v="{v}"/>' for k, v in tags.items())
        node = f'<node id="{90_000 + row}" lat="{latitude}" lon="{longitude}">{inner}</node>'
        text = text.replace("<way ", f"{node}<way ", 1)
    (tmp_path / "all.osm").write_text(text)
    network = load_network(map_spec(str(tmp_path / "all.osm")), tmp_path)
    found = {item.kind for item in network.features.objects}
    assert found == {*rules.points.values(), *rules.lines.values(), ObjectKind.POLE}
    terrain = Terrain(network)
    scenes = [build_region(network, region, terrain) for region in regions_of(network.layout)]
    (lamp,) = (item for item in network.features.objects if item.kind is ObjectKind.STREET_LAMP)
    lights_m = np.array([light.position_m[:2] for scene in scenes for light in scene.street_lights])
    near_m = np.sort(np.hypot(*(lights_m - lamp.points_m[0, :2]).T))
    assert near_m[0] == pytest.approx(1.75, abs=0.01) and near_m[1] > 75.0, "generated ones only far from it"
