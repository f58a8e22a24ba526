"""Footways on the verges of an OpenStreetMap file without sidewalks and footpaths: in the net, but not paved."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.lane_graph.verges import VERGE_MAX_MPS
from simbev_ros.maps.osm.data import Tags
from simbev_ros.maps.osm.roads import OsmRoad
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.sumo.layout import layout_of
from simbev_ros.maps.sumo.net import SumoNet

_MAX_KMH = VERGE_MAX_MPS * 3.6
_NEAR_CROSSING_M = 15.0


def with_verges(roads: Sequence[OsmRoad]) -> tuple[OsmRoad, ...]:
    """The roads, with sidewalks beside slow ones on the ground if there is no sidewalk or footpath anywhere."""
    if any(road.way.walk or road.way.tags.get("sidewalk") != "no" for road in roads):
        return tuple(roads)
    return tuple(
        replace(road, way=road.way._replace(tags={**road.way.tags, "sidewalk": "both"})) if _is_walked(road) else road
        for road in roads
    )


def is_marked_crossing(tags: Tags) -> bool:
    """Whether a node is a crossing with paint on the road."""
    return tags.get("highway") == "crossing" and tags.get("crossing") != "unmarked"


def unpaved_layout_of(net: SumoNet, crossings_m: Float64Array) -> Layout:
    """The layout of a net without its sidewalks; of its crosswalks those near (N, 2) marked crossings are kept."""
    layout = layout_of(net)
    walks = (LaneKind.SIDEWALK, LaneKind.WALKING_AREA)
    crosswalks = [
        each
        for each in layout.crosswalks
        if np.any(np.linalg.norm(crossings_m - each.outline_m[:, :2].mean(axis=0), axis=1) < _NEAR_CROSSING_M)
    ]
    strips = [strip for strip in layout.strips if strip.kind not in walks]
    kept = {strip.id for strip in strips}
    strips = [
        replace(strip, left=strip.left if strip.left in kept else "", right=strip.right if strip.right in kept else "")
        for strip in strips
    ]
    return replace(layout, strips=tuple(strips), crosswalks=tuple(crosswalks))


def _is_walked(road: OsmRoad) -> bool:
    is_on_ground = not (road.way.bridge or road.way.tunnel or road.way.layer)
    return is_on_ground and float(road.way.tags["maxspeed"]) <= _MAX_KMH
