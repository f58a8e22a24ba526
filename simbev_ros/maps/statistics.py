"""Summary figures of a map (extent, lane lengths, counts of features), and its busiest position."""

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import cKDTree

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.surface import FAST_MPS, strip_polygons

_CLUSTER_M = 25.0
_MIN_OVERLAP_M2 = 1.0
_SPACING_M, _DENSITY_RADIUS_M = 15.0, 180.0
_FAST_WEIGHT = 0.2
_USE_WEIGHT = {"downtown": 2.0, "industrial": 0.5, "farmland": 0.5, "woods": 0.5}


@dataclass(frozen=True, slots=True)
class MapStatistics:
    """Summary figures of a map.

    Attributes:
        width_m: Extent of the roads from west to east.
        depth_m: Extent of the roads from south to north.
        lane_km: Length of the lanes outside junctions, by kind.
        junctions: Number of junctions, not counting dead ends.
        signals: Number of traffic-light heads.
        signs: Number of traffic signs.
        crosswalks: Number of marked crosswalks.
        lowest_m: Lowest point of any lane, map frame.
        highest_m: Highest point of any lane, map frame.
        levels: Number of levels; 1 if no road passes over another or over water.
        two_level_crossings: Number of sites where roads pass over roads; carriageways of one road count once.
        zones: Number of areas with their own surroundings.
        prescribed_buildings: Number of buildings in the map's file; None if buildings are generated.
        water_areas: Number of rivers, lakes and ponds.
    """

    width_m: float
    depth_m: float
    lane_km: dict[str, float]
    junctions: int
    signals: int
    signs: int
    crosswalks: int
    lowest_m: float
    highest_m: float
    levels: int
    two_level_crossings: int
    zones: int
    prescribed_buildings: int | None
    water_areas: int


def statistics_of(network: RoadNetwork) -> MapStatistics:
    """The summary figures of a map."""
    layout, features = network.layout, network.features
    points_m = np.concatenate([strip.center_m for strip in layout.strips if strip.outline_m is None])
    low_m, high_m = points_m.min(axis=0), points_m.max(axis=0)
    return MapStatistics(
        width_m=float(high_m[0] - low_m[0]),
        depth_m=float(high_m[1] - low_m[1]),
        lane_km=_lane_km(layout),
        junctions=len(network.junctions),
        signals=len(network.signals),
        signs=len(layout.signs),
        crosswalks=len(layout.crosswalks),
        lowest_m=float(low_m[2]),
        highest_m=float(high_m[2]),
        levels=len(layout.levels),
        two_level_crossings=_two_level_crossings(layout),
        zones=len(features.zones),
        prescribed_buildings=None if features.buildings is None else len(features.buildings),
        water_areas=len(features.water),
    )


def busiest_position(network: RoadNetwork) -> Float64Array:
    """(2,) position on a driving lane, map frame, with the highest density of lanes around it.

    Lanes in downtown have the highest weight, motorways the lowest.
    """
    waypoints = network.waypoints(_SPACING_M)
    positions_m, lanes = waypoints.position_m[:, :2], [network.lanes[lane] for lane in waypoints.lane]
    if not lanes:  # all lanes are too short for a vehicle to start on
        lanes = [lane for lane in network.lanes.values() if lane.kind is LaneKind.DRIVING]
        positions_m = np.array([lane.centerline_m[0, :2] for lane in lanes])
    weight = np.array([_USE_WEIGHT.get(use, 1.0) for use in network.features.uses_at(positions_m)])
    weight[[lane.speed_mps > FAST_MPS for lane in lanes]] = _FAST_WEIGHT
    around = np.zeros(len(positions_m))
    for each in np.unique(weight).tolist():
        tree = cKDTree(positions_m[weight == each])
        around += each * tree.query_ball_point(positions_m, _DENSITY_RADIUS_M, return_length=True)
    return positions_m[int(np.argmax(around))]


def _lane_km(layout: Layout) -> dict[str, float]:
    length_km = dict.fromkeys((kind.value for kind in LaneKind), 0.0)
    for strip in layout.strips:
        if not strip.junction:
            length_km[strip.kind] += shapely.LineString(strip.center_m).length / 1000.0
    return {kind: length for kind, length in length_km.items() if length > 0.0}


def _two_level_crossings(layout: Layout) -> int:
    """Number of clusters of overlaps between driving lanes of different levels."""
    strips = layout.strips_of(LaneKind.DRIVING)
    boxes = shapely.box(*np.array([_bounds_m(strip) for strip in strips]).reshape(-1, 4).T)
    raised = np.array([strip.level > 0 for strip in strips], bool)
    near = np.unique(shapely.STRtree(boxes[raised]).query(boxes)[0])
    areas, level = strip_polygons([strips[k] for k in near]), np.array([strips[k].level for k in near])
    one, other = shapely.STRtree(areas).query(areas, predicate="intersects")
    above = level[one] > level[other]
    overlaps = overlay.intersection(areas[one[above]], areas[other[above]])
    large = overlaps[shapely.area(overlaps) > _MIN_OVERLAP_M2]
    return len(shapely.get_parts(overlay.union_all(shapely.buffer(large, _CLUSTER_M / 2.0))))


def _bounds_m(strip: Strip) -> Float64Array:
    """(4,) lowest and highest x and y of a strip, in the order of ``shapely.box``."""
    borders_m = np.concatenate([strip.left_m[:, :2], strip.right_m[:, :2]])
    return np.concatenate([borders_m.min(axis=0), borders_m.max(axis=0)])
