"""Map objects stand where the file says, are hit by the lidar's rays as their class, and replace generated ones."""

from pathlib import Path

import numpy as np
import pytest
from synthetic_world import world

from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.assets.regions.build import build_region
from simbev_ros.assets.regions.region_scene import RegionScene
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.build import load_network
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.opendrive.roadside_objects import object_types
from simbev_ros.maps.region import regions_of
from simbev_ros.maps.source import map_spec
from simbev_ros.schema.scene.state import ACTOR_DTYPE
from simbev_ros.simulation.raycast.scene import RayScene

LAND_M = 0.1
LAMPS = '<repeat s="10" length="80" distance="40" tStart="6" tEnd="6"/>'
OBJECTS = f"""
<object id="1" type="barrier" s="50" t="-8" hdg="{np.radians(30.0)}" length="4" width="2" height="3"/>
<object id="2" type="pole" s="20" t="-6" radius="0.2" height="4"/>
<object id="3" type="barrier" subtype="fence" s="0" t="0" height="1.5">
 <repeat s="60" length="20" distance="0" tStart="-7" tEnd="-7" widthStart="0.1" widthEnd="0.1"/></object>
<object id="4" type="barrier" subtype="guardRail" s="85" t="-5" length="8" width="0.2" height="0.75"/>
<object id="5" type="vegetation" subtype="hedge" s="30" t="-6" length="4" width="1" height="1.5"/>
<object id="6" type="building" s="50" t="20" length="20" width="10" height="9"/>
<object id="7" type="streetLamp" s="0" t="0" height="6">{LAMPS}</object>
<object id="8" type="obstacle" s="10" t="-6" length="1" width="1" height="1" zOffset="1"/>
<object id="9" type="tree" s="70" t="12" height="8"/>
"""
ROAD = """<OpenDRIVE><road id="1" length="100" junction="-1"><link/><planView>
<geometry s="0" x="0" y="20" hdg="0" length="100"><line/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right><lane id="-1" type="driving">
<width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection></lanes>
<objects>{}</objects></road></OpenDRIVE>"""


def build(path: Path, text: str) -> list[RegionScene]:
    """The regions of a map file."""
    path.write_text(text)
    network = load_network(map_spec(str(path)), path.parent)
    terrain = Terrain(network)
    return [build_region(network, region, terrain) for region in regions_of(network.layout)]


@pytest.fixture(scope="module")
def static(tmp_path_factory: pytest.TempPathFactory) -> StaticScene:
    """A road along y = 20, whose first region begins at x = 0."""
    scenes = build(tmp_path_factory.mktemp("objects") / "road.xodr", ROAD.format(OBJECTS))
    lights = [light for scene in scenes for light in scene.street_lights]
    return StaticScene(tuple(tile for scene in scenes for tile in scene.tiles), tuple(lights))


@pytest.fixture(scope="module")
def rays(static: StaticScene) -> RayScene:
    scene = RayScene(static, ())
    scene.update(world(np.zeros(0, ACTOR_DTYPE)), np.array([50.0, 20.0, 1.0]), 100.0)
    return scene


@pytest.mark.parametrize(
    ("x", "z", "tag", "range_m"),
    [
        (50.0, 1.0, Tag.WALL, 8.0 - 1.0 / np.cos(np.radians(30.0))),  # the box's left face, 1 m from its center
        (50.0, LAND_M + 2.99, Tag.WALL, 8.0 - 1.0 / np.cos(np.radians(30.0))),
        (20.0, 2.0, Tag.POLE, 5.8),
        (70.0, 1.0, Tag.FENCE, 6.95),
        (85.0, 0.5, Tag.GUARD_RAIL, 4.9),
        (30.0, 1.0, Tag.VEGETATION, 5.5),
        (10.0, LAND_M + 1.5, Tag.STATIC, 5.5),
    ],
)
def test_a_ray_hits_an_object_at_its_distance_as_its_class(
    rays: RayScene, x: float, z: float, tag: Tag, range_m: float
) -> None:
    hits = rays.cast(np.array([[x, 20.0, z]]), np.array([[0.0, -1.0, 0.0]]))
    assert Tag(hits.tag[0]) is tag
    assert hits.range_m[0] == pytest.approx(range_m, abs=0.02 if tag is Tag.POLE else 1e-3)


@pytest.mark.parametrize(
    ("x", "z"), [(50.0, LAND_M + 3.05), (20.0, LAND_M + 4.05), (10.0, LAND_M + 0.5), (59.5, 1.0), (80.5, 1.0)]
)
def test_a_ray_passes_above_below_and_beside_objects(rays: RayScene, x: float, z: float) -> None:
    hits = rays.cast(np.array([[x, 20.0, z]]), np.array([[0.0, -1.0, 0.0]]))
    assert not hits.range_m[0] < 10.0


def test_the_building_and_the_tree_on_the_other_side_are_hit(rays: RayScene) -> None:
    origins = np.array([[52.0, 20.0, 5.0], [70.0, 20.0, 1.0]])
    hits = rays.cast(origins, np.tile([0.0, 1.0, 0.0], (2, 1)))
    assert [Tag(tag) for tag in hits.tag] == [Tag.BUILDING, Tag.VEGETATION]
    assert hits.range_m == pytest.approx([15.0, 12.0], abs=0.4)


def test_lamps_of_the_map_replace_generated_ones(static: StaticScene) -> None:
    positions_m = np.array([light.position_m for light in static.street_lights])
    assert positions_m[:, 0] == pytest.approx([10.0, 50.0, 90.0], abs=0.1)
    # The lamp of the model, which is 8 m high, hangs 1.75 m before its pole, at 7.82 m. These are 6 m high.
    assert positions_m[:, 1] == pytest.approx([26.0 - 1.75 * 0.75] * 3, abs=0.01), "they face the road"
    assert positions_m[:, 2] == pytest.approx([LAND_M + 7.82 * 0.75] * 3, abs=0.01)


def test_every_type_of_the_table_is_built(tmp_path: Path) -> None:
    items = []
    for row, name in enumerate(object_types()):
        main, _, subtype = name.partition("/")
        repeat = '<repeat s="0" length="20" distance="0" tStart="30" tEnd="30"/>'
        items += [
            f'<object type="{main}" subtype="{subtype}" s="{3 * row}" t="{-15 - 12 * (row % 2)}">{inner}</object>'
            for inner in ("", repeat)
        ]
    tags = {Tag(tag) for scene in build(tmp_path / "all.xodr", ROAD.format("".join(items))) for tag in _tags(scene)}
    expected = (Tag.BUILDING, Tag.WALL, Tag.FENCE, Tag.POLE, Tag.GUARD_RAIL, Tag.STATIC, Tag.VEGETATION, Tag.GROUND)
    assert tags.issuperset(expected)


def _tags(scene: RegionScene) -> set[int]:
    return {tag for tile in scene.tiles for tag in np.unique(tile.mesh.tag).tolist()}
