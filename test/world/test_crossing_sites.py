"""Where streets are crossed away from crosswalks, against the surfaces of the map."""

import numpy as np
import pytest
import shapely

from simbev_ros.maps.build import load_network
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.surface import FAST_MPS, crosswalk_polygons, surfaces_of
from simbev_ros.maps.spec import MapSpec
from simbev_ros.scene.hazards.hazard import HazardKind, HazardSpec
from simbev_ros.types import Float64Array
from simbev_ros.world.pedestrians.crossing_sites import CrossingPlace, CrossingPlaces


def places_of(town: str, hazards: tuple[HazardSpec, ...] = ()) -> list[CrossingPlace]:
    """A place every 15 m along the sidewalks of a town, where there is one."""
    network = load_network(MapSpec(name=town, seed=0))
    places = CrossingPlaces(network, hazards)
    found = [
        places.place(lane.edge, float(s_m))
        for lane in network.lanes_of(LaneKind.SIDEWALK)
        for s_m in np.arange(*places.stations_m(lane.edge), 15.0)
    ]
    return [place for place in found if place is not None]


def along(place: CrossingPlace, first_m: float, last_m: float) -> shapely.LineString:
    """The part of a way between two distances."""
    ahead: Float64Array = (place.ends_m[1] - place.ends_m[0])[:2] / place.length_m
    return shapely.LineString([place.ends_m[0, :2] + first_m * ahead, place.ends_m[0, :2] + last_m * ahead])


@pytest.mark.parametrize(("town", "least"), [("Blocks", 300), ("Town02", 80), ("Town10HD", 30)])
def test_ways_lead_from_sidewalk_to_sidewalk_over_nothing_but_road_and_keep_off_crosswalks(
    town: str, least: int
) -> None:
    network = load_network(MapSpec(name=town, seed=0))
    levels = [surfaces_of(network.layout, level) for level in network.layout.levels]
    road = shapely.union_all([part for each in levels for part in (each.road, each.shoulder)]).buffer(0.3)
    sidewalk = shapely.union_all([each.sidewalk for each in levels]).buffer(0.3)
    crosswalks = shapely.union_all(crosswalk_polygons(network.layout.crosswalks))
    for area in (road, sidewalk, crosswalks):
        shapely.prepare(area)
    places = places_of(town)
    assert len(places) > least
    for place in places:
        near_kerb_m, far_kerb_m = place.kerbs_m
        assert road.contains(along(place, near_kerb_m, far_kerb_m))
        assert sidewalk.contains(along(place, 0.0, near_kerb_m))
        assert sidewalk.contains(along(place, far_kerb_m, place.length_m))
        assert crosswalks.distance(along(place, 0.0, place.length_m)) > 8.0
        assert place.carriageways[-1].until_m == pytest.approx(far_kerb_m, abs=0.7)
        edges = {part.edge for part in place.carriageways}
        assert all(lane.speed_mps <= FAST_MPS for lane in network.lanes.values() if lane.edge in edges)


def test_nobody_crosses_through_a_hazard_area() -> None:
    everywhere = places_of("Blocks")
    x_m, y_m = everywhere[0].ends_m.mean(axis=0)[:2]
    square = tuple((float(x_m + i), float(y_m + j)) for i, j in ((-3, -3), (3, -3), (3, 3), (-3, 3)))
    left = places_of("Blocks", (HazardSpec(kind=HazardKind.ACCIDENT, outline_m=square),))
    assert 0 < len(everywhere) - len(left) < 8
    assert all(along(place, 0.0, place.length_m).distance(shapely.Polygon(square)) > 3.0 for place in left)
