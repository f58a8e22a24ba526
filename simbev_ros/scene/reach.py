"""Region of interest of a scene: the part of a map that its agents can drive to or see."""

import heapq
from collections import defaultdict

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.region import Reach, Reaches, regions_of
from simbev_ros.schema.scene.agents import AgentView, agent_views
from simbev_ros.schema.scene.spec import SceneSpec

VIEW_M = 500.0
"""Distance up to which cameras see detail beyond bare terrain."""

_MAX_WHOLE_REGIONS = 12  # maps with at most this number of regions are loaded whole, so that scenes share them
_MARGIN_M = 30.0


def loaded_reach(spec: SceneSpec, network: RoadNetwork, view_m: float = VIEW_M) -> Reach | Reaches | None:
    """The part of a map to load for a scene with all its agents; None means all of it, because the map is small."""
    if len(regions_of(network.layout)) <= _MAX_WHOLE_REGIONS:
        return None
    circles = tuple(reach_of(view, network, view_m) for view in agent_views(spec))
    return circles[0] if len(circles) == 1 else Reaches(circles)


def reach_of(view: AgentView, network: RoadNetwork, view_m: float = VIEW_M) -> Reach:
    """Circle around an agent's start: the distance that it can drive in the scene, plus ``view_m``."""
    if view.station is not None:
        return Reach((view.station.x_m, view.station.y_m), _MARGIN_M + view_m)
    scene, vehicle = view.scene, view.vehicle
    assert vehicle is not None
    start_m, _ = network.pose_on_lane(vehicle.start.lane, vehicle.start.s_m)
    duration_s = (scene.warm_up_ticks + scene.ticks) * scene.tick_ns / NS_PER_S
    travel_m = _max_travel_m(network, start_m[:2], vehicle.start.lane, duration_s * max(vehicle.speed_factor, 1.0))
    return Reach((float(start_m[0]), float(start_m[1])), travel_m + _MARGIN_M + view_m)


def _max_travel_m(network: RoadNetwork, start_m: Float64Array, lane: str, duration_s: float) -> float:
    """Distance of the farthest point reachable from a lane's start at the speed limits; lane changes are free."""
    lanes_by_edge: dict[str, list[Lane]] = defaultdict(list)
    for each in network.lanes.values():
        lanes_by_edge[each.edge].append(each)
    queue, reached, max_distance_m = [(0.0, network.lanes[lane].edge)], set(), 0.0
    while queue:
        entry_s, edge = heapq.heappop(queue)
        if edge in reached:
            continue
        reached.add(edge)
        for each in lanes_by_edge[edge]:
            line_m = each.centerline_m[:, :2]
            along_s = np.cumsum([0.0, *np.linalg.norm(np.diff(line_m, axis=0), axis=1)]) / max(each.speed_mps, 1.0)
            reachable = (
                entry_s + np.append(0.0, along_s[:-1]) <= duration_s
            )  # including the first vertex beyond the time limit
            max_distance_m = max(
                max_distance_m, float(np.linalg.norm(line_m[reachable] - start_m, axis=1).max(initial=0.0))
            )
            exit_s = entry_s + float(along_s[-1])
            if exit_s <= duration_s:
                for successor in each.successors:
                    heapq.heappush(queue, (exit_s, network.lanes[successor].edge))
    return max_distance_m
