"""How much of a map a scene can see."""

import numpy as np

from simbev_ros.maps.lane_kind import LaneKind
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import Reach
from simbev_ros.scene.spec import NS_PER_S, SceneSpec

_VIEW_M = 500.0


def reach_of(spec: SceneSpec, network: RoadNetwork) -> Reach:
    """A circle around the ego's start: as far as it can get on the map's fastest road, and as far as one sees there."""
    ego = spec.vehicles[0]
    start_m, _ = network.pose_on_lane(ego.start.lane, ego.start.s_m)
    fastest_mps = max(lane.speed_mps for lane in network.lanes_of(LaneKind.DRIVING)) * max(ego.speed_factor, 1.0)
    seconds = (spec.warm_up_ticks + spec.ticks) * spec.tick_ns / NS_PER_S
    places_m = np.concatenate([lane.centerline_m[:, :2] for lane in network.lanes.values()])
    farthest_m = float(np.linalg.norm(places_m - start_m[:2], axis=1).max())
    travel_m = min(fastest_mps * seconds, farthest_m)
    return Reach((float(start_m[0]), float(start_m[1])), travel_m + _VIEW_M)
