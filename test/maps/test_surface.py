import numpy as np
import pytest
import shapely
from shapely import MultiPolygon

from simbev_ros.maps.lane_kind import LaneKind
from simbev_ros.maps.markings import MarkingKind, lane_markings
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.recipe import recipe_of
from simbev_ros.maps.surface import crossing_polygons, lane_polygon, road_surface, sidewalk_surface
from simbev_ros.types import Float64Array


@pytest.fixture(scope="module")
def road(blocks: RoadNetwork) -> MultiPolygon:
    return road_surface(blocks)


@pytest.fixture(scope="module")
def sidewalk(blocks: RoadNetwork, road: MultiPolygon) -> MultiPolygon:
    return sidewalk_surface(blocks, road)


def _points_beside(blocks: RoadNetwork, kind: LaneKind, left_m: float) -> Float64Array:
    """(N, 2) points beside the middles of all street lanes of a kind; ``left_m`` is counted from the left border."""
    lanes = [lane for lane in blocks.lanes_of(kind) if not lane.junction]
    poses = [blocks.pose_on_lane(lane.id, lane.length_m * part) for lane in lanes for part in (0.05, 0.5, 0.95)]
    offsets_m = np.repeat([lane.width_m / 2.0 + left_m for lane in lanes], 3)
    yaw_rad = np.array([yaw for _, yaw in poses])
    left = np.stack([-np.sin(yaw_rad), np.cos(yaw_rad)], axis=1)
    middles_m: Float64Array = np.array([position_m[:2] for position_m, _ in poses])
    middles_m += offsets_m[:, None] * left
    return middles_m


def test_road_has_no_hole_but_the_blocks(road: MultiPolygon, sidewalk: MultiPolygon) -> None:
    streets = recipe_of("Blocks").streets
    blocks_left = streets.columns * streets.rows - streets.merged_blocks
    assert road.is_valid
    assert len(road.geoms) == 1
    assert len(road.geoms[0].interiors) == blocks_left
    assert sidewalk.is_valid
    assert len(sidewalk.geoms) == blocks_left + 1, "one around each block and one outside the ring"


def test_road_covers_every_lane_and_adds_only_corners(blocks: RoadNetwork, road: MultiPolygon) -> None:
    lanes = shapely.union_all([lane_polygon(lane) for lane in blocks.lanes_of(LaneKind.DRIVING)])
    assert shapely.difference(lanes, road).area < 1e-3 * lanes.area
    assert lanes.area <= road.area < 1.03 * lanes.area
    street_lanes = [lane_polygon(lane).area for lane in blocks.lanes_of(LaneKind.DRIVING) if not lane.junction]
    straight = [lane.length_m * lane.width_m for lane in blocks.lanes_of(LaneKind.DRIVING) if not lane.junction]
    assert sum(street_lanes) == pytest.approx(sum(straight), rel=1e-4)


def test_road_and_sidewalk_share_no_area_and_leave_no_gap(
    blocks: RoadNetwork, road: MultiPolygon, sidewalk: MultiPolygon
) -> None:
    assert shapely.intersection(road, sidewalk).area == 0.0
    beyond_curb = shapely.points(_points_beside(blocks, LaneKind.SIDEWALK, 0.01))
    before_curb = shapely.points(_points_beside(blocks, LaneKind.SIDEWALK, -0.01))
    assert shapely.contains(road, beyond_curb).all()
    assert shapely.contains(sidewalk, before_curb).all()
    both = shapely.union_all([road, sidewalk], grid_size=0.001)
    assert both.area == pytest.approx(road.area + sidewalk.area, abs=0.1)
    assert sum(len(part.interiors) for part in shapely.get_parts(both)) == len(sidewalk.geoms) - 1


def test_crossings_lie_on_the_road_from_curb_to_curb(
    blocks: RoadNetwork, road: MultiPolygon, sidewalk: MultiPolygon
) -> None:
    crossings = np.array(crossing_polygons(blocks))
    assert len(crossings) == len(blocks.lanes_of(LaneKind.CROSSING)) > 50
    assert shapely.area(shapely.difference(crossings, road)).max() < 1e-2
    ends = np.array([lane.centerline_m[[0, -1], :2] for lane in blocks.lanes_of(LaneKind.CROSSING)]).reshape(-1, 2)
    assert shapely.distance(shapely.points(ends), sidewalk).max() < 0.3


def test_paint_is_on_the_road_and_never_on_other_paint(blocks: RoadNetwork, road: MultiPolygon) -> None:
    paint = np.array([marking.polygon for marking in lane_markings(blocks)])
    assert shapely.is_valid(paint).all()
    assert shapely.area(shapely.difference(paint, road)).max() < 1e-3
    assert shapely.union_all(paint).area == pytest.approx(shapely.area(paint).sum(), rel=1e-6)


def test_inside_junctions_only_crosswalks_are_painted(blocks: RoadNetwork) -> None:
    inside = shapely.union_all(
        [lane_polygon(lane) for lane in blocks.lanes_of(LaneKind.DRIVING) if lane.junction], grid_size=0.001
    )
    crossings = shapely.union_all(crossing_polygons(blocks))
    for marking in lane_markings(blocks):
        if marking.kind is MarkingKind.CROSSWALK:
            assert shapely.difference(marking.polygon, crossings).area < 1e-6
        else:
            # Turning lanes begin askew, so their corners reach a little way back beside the end of the centre line.
            assert shapely.intersection(marking.polygon, inside).area < 0.03


def test_center_lines_part_opposite_directions_and_dashes_the_same(blocks: RoadNetwork) -> None:
    painted = {
        kind: shapely.union_all([marking.polygon for marking in lane_markings(blocks) if marking.kind is kind])
        for kind in MarkingKind
    }
    edges: dict[str, int] = {}
    for lane in blocks.lanes_of(LaneKind.DRIVING):
        if not lane.junction:
            edges[lane.edge] = edges.get(lane.edge, 0) + 1
    streets_m = sum(blocks.lanes[f"{edge}_1"].length_m for edge in edges) / 2.0
    assert painted[MarkingKind.CENTER].area == pytest.approx(2 * 0.12 * streets_m, rel=0.01)
    two_lanes_m = sum(blocks.lanes[f"{edge}_1"].length_m for edge, lanes in edges.items() if lanes == 2)
    assert painted[MarkingKind.LANE].area == pytest.approx(0.12 * two_lanes_m * 3.0 / 9.0, rel=0.1)
    assert painted[MarkingKind.EDGE].is_empty, "no one-way street"


def test_each_signalised_approach_has_one_stop_line_across_its_lanes(blocks: RoadNetwork) -> None:
    stops = [marking.polygon for marking in lane_markings(blocks) if marking.kind is MarkingKind.STOP]
    approaches: dict[str, list[str]] = {}
    for signal in blocks.signals:
        approaches.setdefault(blocks.lanes[signal.lane].edge, []).append(signal.lane)
    assert len(stops) == len(approaches)
    for lanes in approaches.values():
        before_end = [blocks.pose_on_lane(lane, blocks.lanes[lane].length_m - 0.5)[0] for lane in lanes]
        assert any(shapely.contains_xy(stop, np.array(before_end)[:, :2]).all() for stop in stops)
