"""Sites where pedestrians cross streets away from crosswalks, checked against the surfaces of the map."""

import numpy as np
import pytest
import shapely

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.surface import FAST_MPS, crosswalk_polygons, surfaces_of
from simbev_ros.schema.scene.hazard import HazardKind, HazardSpec
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.simulation.world.pedestrians.crossing_sites import CrossingSite, CrossingSites


def sites_of(town: str, hazards: tuple[HazardSpec, ...] = ()) -> list[CrossingSite]:
    """The crossing sites found every 15 m along the sidewalks of a town."""
    network = load_network(MapSpec(name=town, seed=0))
    finder = CrossingSites(network, hazards)
    found = [
        finder.site_at(lane.edge, float(s_m))
        for lane in network.lanes_of(LaneKind.SIDEWALK)
        for s_m in np.arange(*finder.stations_m(lane.edge), 15.0)
    ]
    return [site for site in found if site is not None]


def segment(site: CrossingSite, first_m: float, last_m: float) -> shapely.LineString:
    """The part of a crossing path between two distances."""
    ahead: Float64Array = (site.ends_m[1] - site.ends_m[0])[:2] / site.length_m
    return shapely.LineString([site.ends_m[0, :2] + first_m * ahead, site.ends_m[0, :2] + last_m * ahead])


@pytest.mark.parametrize(("town", "min_count"), [("Blocks", 300), ("Town02", 80), ("Town10HD", 30)])
def test_crossings_lead_from_sidewalk_to_sidewalk_over_road_only_and_away_from_crosswalks(
    town: str, min_count: int
) -> None:
    network = load_network(MapSpec(name=town, seed=0))
    levels = [surfaces_of(network.layout, level) for level in network.layout.levels]
    road = shapely.union_all([part for each in levels for part in (each.road, each.shoulder)]).buffer(0.3)
    sidewalk = shapely.union_all([each.sidewalk for each in levels]).buffer(0.3)
    crosswalks = shapely.union_all(crosswalk_polygons(network.layout.crosswalks))
    for area in (road, sidewalk, crosswalks):
        shapely.prepare(area)
    finder = sites_of(town)
    assert len(finder) > min_count
    for site in finder:
        near_curb_m, far_curb_m = site.curbs_m
        assert road.contains(segment(site, near_curb_m, far_curb_m))
        assert sidewalk.contains(segment(site, 0.0, near_curb_m))
        assert sidewalk.contains(segment(site, far_curb_m, site.length_m))
        assert crosswalks.distance(segment(site, 0.0, site.length_m)) > 8.0
        assert site.carriageways[-1].cleared_m == pytest.approx(far_curb_m, abs=0.7)
        edges = {part.edge for part in site.carriageways}
        assert all(lane.speed_mps <= FAST_MPS for lane in network.lanes.values() if lane.edge in edges)


def test_no_crossing_leads_through_a_hazard_area() -> None:
    all_sites = sites_of("Blocks")
    x_m, y_m = all_sites[0].ends_m.mean(axis=0)[:2]
    square = tuple((float(x_m + i), float(y_m + j)) for i, j in ((-3, -3), (3, -3), (3, 3), (-3, 3)))
    remaining = sites_of("Blocks", (HazardSpec(kind=HazardKind.ACCIDENT, outline_m=square),))
    assert 0 < len(all_sites) - len(remaining) < 8
    assert all(segment(site, 0.0, site.length_m).distance(shapely.Polygon(square)) > 3.0 for site in remaining)
