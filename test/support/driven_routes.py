"""Routes on small maps with events, and an ego that drives along them from outside."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from simbev_ros.maps.lane_path import LanePaths
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.schema.scene.drive_spec import DriveSpec, EventSpec, RouteSpec
from simbev_ros.schema.scene.route_progress import RouteProgress
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.world.simulation import Simulation

_LOOK_AHEAD_M, _LOOK_AHEAD_S = 3.0, 0.4


def route_along(network: RoadNetwork, edges: Sequence[str], lane: str, s_m: float) -> RouteSpec:
    """The route along edges from a position on a lane of the first one."""
    path = LanePaths(network, "passenger").path_along(edges, (network.lanes[lane], s_m), None)
    distance_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path.points_m[:, :2], axis=0).T))])
    return RouteSpec(
        x_m=tuple(path.points_m[:, 0].tolist()),
        y_m=tuple(path.points_m[:, 1].tolist()),
        z_m=tuple(path.points_m[:, 2].tolist()),
        distance_m=tuple(distance_m.tolist()),
        limit_mps=tuple(each.speed_mps for each in path.lanes),
        lane=tuple(each.id for each in path.lanes),
        command=path.commands,
    )


def drive_of(route: RouteSpec, events: Sequence[EventSpec]) -> DriveSpec:
    """A drive along a route with these events."""
    return DriveSpec(route=route, goal_radius_m=5.0, standstill_s=60.0, off_route_m=30.0, events=tuple(events))


def drive_along(
    spec: SceneSpec,
    network: RoadNetwork,
    speed_mps: Callable[[WorldState, Simulation], float],
    gives_way_m: float = 0.0,
) -> tuple[list[WorldState], Simulation]:
    """States of a scene whose ego follows its route by pure pursuit.

    ``speed_mps`` gives the desired speed in a state. From the begin of the first event on, the ego drives
    ``gives_way_m`` to the left of its route.
    """
    assert spec.drive is not None
    route, states = spec.drive.route, []
    stations_m, points_m = np.array(route.distance_m), route.points_m
    progress = RouteProgress(route)
    with Simulation(spec, network) as simulation:
        for _ in range(spec.warm_up_ticks + spec.ticks):
            state = simulation.step()
            states.append(state)
            driver = simulation._outside_drivers._drivers[0]
            heading = (driver.front_m - driver.axle_m)[:2]
            desired_mps = speed_mps(state, simulation) if state.tick >= 0 else 0.0
            ahead_m = progress.advance_to(driver.axle_m).distance_m + _LOOK_AHEAD_M + _LOOK_AHEAD_S * desired_mps
            goal_m = np.array([np.interp(ahead_m, stations_m, points_m[:, axis]) for axis in range(2)])
            if gives_way_m and simulation.route_events.records[0].begin_tick is not None:
                goal_m = goal_m + gives_way_m * np.array([-heading[1], heading[0]]) / np.linalg.norm(heading)
            x_m, y_m = goal_m - driver.axle_m[:2]
            bearing_rad = math.remainder(math.atan2(y_m, x_m) - math.atan2(heading[1], heading[0]), 2.0 * math.pi)
            yaw_rate_radps = 2.0 * desired_mps * math.sin(bearing_rad) / max(math.hypot(x_m, y_m), 1.0)
            simulation.drive_vehicle(0, desired_mps, yaw_rate_radps)
    return states, simulation
