"""The roads in plan: asphalt, sidewalks and crossings as exact shapely geometry in the map frame, metres.

Asphalt is the union of the driving lanes, those inside junctions included, with the gaps between them closed and the
corners rounded. Sidewalk is all else between the streets' outer edges, so that the two share their border and nothing
else.
"""

import shapely
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from simbev_ros.maps.lane_kind import LaneKind
from simbev_ros.maps.network import Lane, RoadNetwork

_CLOSING_M = 3.0
_GRID_M = 0.001
_SPECK_M2 = 0.01
_ROAD_KINDS = (LaneKind.DRIVING, LaneKind.BICYCLE, LaneKind.PARKING)


def lane_polygon(lane: Lane) -> Polygon:
    """A lane's area: its outline if it has one, otherwise its centre line widened by half its width to both sides."""
    if lane.outline_m is None:
        line = LineString(lane.centerline_m[:, :2])
        return shapely.buffer(line, lane.width_m / 2.0, cap_style="flat", join_style="mitre")
    return max(_polygons(shapely.make_valid(Polygon(lane.outline_m))).geoms, key=lambda part: part.area)


def road_surface(network: RoadNetwork) -> MultiPolygon:
    """The carriageway: driving, bicycle and parking lanes and all between them, under crossings too."""
    lanes = [lane_polygon(lane) for lane in network.lanes_of(*_ROAD_KINDS)]
    return _polygons(_closed(shapely.union_all([*lanes, *crossing_polygons(network)])))


def sidewalk_surface(network: RoadNetwork, road: BaseGeometry | None = None) -> MultiPolygon:
    """Sidewalks and walking areas, up to the curb.

    Args:
        network: The roads.
        road: ``road_surface(network)``, to save its computation.
    """
    road = road_surface(network) if road is None else road
    walks = [lane_polygon(lane) for lane in network.lanes_of(LaneKind.SIDEWALK, LaneKind.WALKING_AREA)]
    street = _closed(shapely.union_all([*walks, road]))
    near_walks = shapely.buffer(shapely.union_all(walks), _CLOSING_M)
    return _polygons(shapely.difference(shapely.intersection(street, near_walks), road, grid_size=_GRID_M))


def crossing_polygons(network: RoadNetwork) -> tuple[Polygon, ...]:
    """The area of each crosswalk, in the order of the network's lanes."""
    return tuple(lane_polygon(lane) for lane in network.lanes_of(LaneKind.CROSSING))


def _closed(area: BaseGeometry) -> BaseGeometry:
    """The area with narrow gaps and inner corners filled (morphological closing), on a millimetre grid."""
    grown = shapely.buffer(area, _CLOSING_M, quad_segs=12)
    closed = shapely.union(shapely.buffer(grown, -_CLOSING_M, quad_segs=12), area)
    return shapely.set_precision(shapely.simplify(closed, 2 * _GRID_M), _GRID_M)


def _polygons(area: BaseGeometry) -> MultiPolygon:
    """Only the two-dimensional parts, without specks."""
    parts = shapely.get_parts(area)
    parts = parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON]
    return MultiPolygon(list(parts[shapely.area(parts) > _SPECK_M2]))
