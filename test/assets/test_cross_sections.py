"""Vertical rays onto roads with banked, crowned, level and raised lanes hit the heights that the file states."""

from collections.abc import Iterator
from dataclasses import replace
from math import cos, sin, tan

import numpy as np
import open3d
import pytest

from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.placement.tiles import TileBuilder
from simbev_ros.assets.roads.ground import lay_streets
from simbev_ros.maps.build import load_network
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.region import regions_of
from simbev_ros.maps.source import map_spec
from simbev_ros.simulation.world.kinematics.ground import GroundSurface

LENGTH_M, SPEED = 160.0, '<speed sOffset="0" max="14"/>'
LANES = (  # number, kind, width, further attributes and elements, heights of inner and outer border at both ends
    (2, "sidewalk", 2.5, "", ((0.05, 0.05), (0.05, 0.05))),
    (1, "driving", 3.5, "", None),
    (-1, "driving", 3.5, "", None),
    (-2, "bicycle", 2.0, "", ((0.06, 0.06), (0.06, 0.12))),
    (-3, "sidewalk", 3.0, "", ((0.2, 0.3), (0.3, 0.2))),
)
BANK, CLIMB, FALL = 0.04, 0.03, 0.025


def file_text(lateral: str) -> str:
    def lane(number: int, kind: str, width_m: float, attributes: str, heights: object) -> str:
        at = (0.0, LENGTH_M)
        rows = zip(at, heights, strict=True) if heights else ()  # type: ignore[call-overload]
        records = "".join(f'<height sOffset="{s}" inner="{i}" outer="{o}"/>' for s, (i, o) in rows)
        width = f'<width sOffset="0" a="{width_m}" b="0" c="0" d="0"/>'
        return f'<lane id="{number}" type="{kind}" {attributes}>{width}{records}</lane>'

    left, right = ("".join(lane(*row) for row in LANES if (row[0] > 0) == up) for up in (True, False))
    return f"""<OpenDRIVE><header revMajor="1" revMinor="6"/><road id="1" length="{LENGTH_M}" junction="-1"><link/>
<planView><geometry s="0" x="-80" y="40" hdg="0" length="{LENGTH_M}"><line/></geometry></planView>
<elevationProfile><elevation s="0" a="2" b="{CLIMB}" c="0" d="0"/></elevationProfile>
<lateralProfile>{lateral}</lateralProfile><lanes><laneSection s="0"><left>{left}</left>
<center><lane id="0" type="none"/></center><right>{right}</right></laneSection></lanes></road></OpenDRIVE>"""


PROFILES = {
    "flat": "",
    "banked": f'<superelevation s="0" a="{BANK}" b="0" c="0" d="0"/>',
    "crowned": f'<crossfall side="both" s="0" a="{FALL}" b="0" c="0" d="0"/>',
}


def stated(profile: str, s_m: float, share: float, lane: int) -> tuple[float, float, float]:
    """The point of a lane at ``share`` from its inner to its outer border: y, height of the plane, and of the lane."""
    side = 1 if lane > 0 else -1
    widths = {number: width_m for number, _, width_m, _, _ in LANES}
    t = side * (sum(widths[side * k] for k in range(1, abs(lane))) + share * widths[lane])
    heights = next(row[4] for row in LANES if row[0] == lane) or ((0.0, 0.0), (0.0, 0.0))
    inner, outer = (a + (b - a) * s_m / LENGTH_M for a, b in zip(*heights, strict=True))
    roll = BANK if profile == "banked" else 0.0
    fall = abs(t) * tan(FALL) if profile == "crowned" else 0.0
    plane_m = 2.0 + CLIMB * s_m + t * sin(roll) - fall * cos(roll)
    return 40.0 + t * cos(roll), plane_m, plane_m + inner + share * (outer - inner)


@pytest.fixture(scope="module", params=sorted(PROFILES))
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple]:  # type: ignore[type-arg]
    folder = tmp_path_factory.mktemp("section")
    (folder / "road.xodr").write_text(file_text(PROFILES[request.param]))
    network = load_network(map_spec(str(folder / "road.xodr")), folder)
    scene, terrain = open3d.t.geometry.RaycastingScene(), Terrain(network)
    for region in regions_of(network.layout):
        tiles = TileBuilder()
        lay_streets(tiles, RegionGround.from_network(network, region, terrain))
        for tile in tiles.finish():
            vertices_m = (tile.mesh.vertices + tile.origin_m).astype(np.float32)
            scene.add_triangles(vertices_m, tile.mesh.triangles.astype(np.uint32))
    yield request.param, network, scene


def positions(profile: str) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) random points of all lanes, away from steps and ends, and (N,) heights of the plane below them."""
    rng = np.random.default_rng(5)
    points, planes_m = [], []
    for number, _, width_m, _, _ in LANES:
        for s_m in rng.uniform(6.0, LENGTH_M - 6.0, 400):
            inset = 0.05 / width_m
            y_m, plane_m, height_m = stated(profile, s_m, rng.uniform(inset, 1.0 - inset), number)
            points.append((s_m - 80.0, y_m, height_m))
            planes_m.append(plane_m)
    return np.array(points), np.array(planes_m)


def test_rays_hit_the_stated_heights(built: tuple) -> None:  # type: ignore[type-arg]
    profile, _, scene = built
    points_m, _ = positions(profile)
    rays = np.column_stack(
        [points_m[:, :2], np.full(len(points_m), 50.0), np.tile([0.0, 0.0, -1.0], (len(points_m), 1))]
    )
    seen_m = 50.0 - scene.cast_rays(rays.astype(np.float32))["t_hit"].numpy()
    error_m = np.abs(seen_m - points_m[:, 2])
    near_crown = np.abs(points_m[:, 1] - 40.0) < 1.75
    assert error_m[~near_crown].max() < 0.02
    assert error_m.max() < (0.05 if profile == "crowned" else 0.02), "a crown is slightly rounded"


def test_wheels_and_feet_stand_at_the_stated_heights(built: tuple) -> None:  # type: ignore[type-arg]
    profile, network, _ = built
    ground = GroundSurface(network.layout)
    points_m, planes_m = positions(profile)
    approximate_m = np.column_stack([points_m[:, :2], planes_m])
    height_m = ground.heights_m(approximate_m) + ground.raised_m(approximate_m)
    near_crown = (np.abs(points_m[:, 1] - 40.0) < 1.75) & (profile == "crowned")
    assert np.abs(height_m - points_m[:, 2])[~near_crown].max() < 0.02


def test_a_flat_map_with_raised_lanes_is_not_level(built: tuple) -> None:  # type: ignore[type-arg]
    _, network, _ = built
    flat = tuple(
        replace(strip, left_m=strip.left_m * [1.0, 1.0, 0.0], right_m=strip.right_m * [1.0, 1.0, 0.0])
        for strip in network.layout.strips
    )
    plain = tuple(replace(strip, raised_m=None) for strip in flat)
    assert not GroundSurface(replace(network.layout, strips=flat)).is_level
    assert GroundSurface(replace(network.layout, strips=plain)).is_level
