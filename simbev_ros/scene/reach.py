"""How much of a map a scene can see."""

import heapq
from collections import defaultdict

import numpy as np

from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.region import Reach, regions_of
from simbev_ros.scene.spec import NS_PER_S, SceneSpec
from simbev_ros.types import Float64Array

VIEW_M = 500.0
"""So far cameras see more than bare land."""

_WHOLE_REGIONS = 12  # maps of so few regions are kept whole, so that scenes share what is loaded
_MARGIN_M = 30.0


def loaded_reach(spec: SceneSpec, network: RoadNetwork, view_m: float = VIEW_M) -> Reach | None:
    """What of a map is to be loaded for a scene: its reach; None: all, because the map is small."""
    return None if len(regions_of(network.layout)) <= _WHOLE_REGIONS else reach_of(spec, network, view_m)


def reach_of(spec: SceneSpec, network: RoadNetwork, view_m: float = VIEW_M) -> Reach:
    """A circle around the ego's start: as far as the roads let it get, and ``view_m`` beyond."""
    ego = spec.vehicles[0]
    start_m, _ = network.pose_on_lane(ego.start.lane, ego.start.s_m)
    seconds = (spec.warm_up_ticks + spec.ticks) * spec.tick_ns / NS_PER_S
    travel_m = _travel_m(network, start_m[:2], ego.start.lane, seconds * max(ego.speed_factor, 1.0))
    return Reach((float(start_m[0]), float(start_m[1])), travel_m + _MARGIN_M + view_m)


def _travel_m(network: RoadNetwork, start_m: Float64Array, lane: str, seconds: float) -> float:
    """Distance of the farthest place that is reached from a lane's start at the speed limits, lanes changed freely."""
    beside: dict[str, list[Lane]] = defaultdict(list)
    for each in network.lanes.values():
        beside[each.edge].append(each)
    queue, reached, farthest_m = [(0.0, network.lanes[lane].edge)], set(), 0.0
    while queue:
        entered_s, edge = heapq.heappop(queue)
        if edge in reached:
            continue
        reached.add(edge)
        for each in beside[edge]:
            line_m = each.centerline_m[:, :2]
            on_way_s = np.cumsum([0.0, *np.linalg.norm(np.diff(line_m, axis=0), axis=1)]) / max(each.speed_mps, 1.0)
            within = entered_s + np.append(0.0, on_way_s[:-1]) <= seconds  # the vertex after the last one in time, too
            farthest_m = max(farthest_m, float(np.linalg.norm(line_m[within] - start_m, axis=1).max(initial=0.0)))
            left_s = entered_s + float(on_way_s[-1])
            if left_s <= seconds:
                for following in each.successors:
                    heapq.heappush(queue, (left_s, network.lanes[following].edge))
    return farthest_m
