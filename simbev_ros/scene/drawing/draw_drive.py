"""Draw the route of the first agent: configuration and start in, points with limits and commands out."""

import logging

import numpy as np

from simbev_ros.config.draw import sample
from simbev_ros.config.drive import Drive
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.lane_path import LanePath, LanePaths
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.scene.blueprints import Blueprint, blueprint_named
from simbev_ros.scene.drawing.draw_agents import DrawnAgents
from simbev_ros.scene.drawing.route_points import routed_ego
from simbev_ros.scene.drawing.spawn import spawn_starts
from simbev_ros.scene.streets.streets import streets_of
from simbev_ros.scene.streets.vehicle_route import route_through
from simbev_ros.schema.scene.drive_spec import DriveSpec, RouteSpec
from simbev_ros.schema.scene.spec import VehicleSpec

_LOGGER = logging.getLogger(__name__)
_MIN_ROUTE_M = 10.0


def draw_drive(
    scenario: Scenario, seed: int, network: RoadNetwork, agents: DrawnAgents
) -> tuple[DrawnAgents, DriveSpec | None]:
    """Draw the route of the first agent, which stays on it if traffic drives it.

    Args:
        scenario: The configuration; without the section ``drive`` there is no route.
        seed: Seed of the scene.
        network: Roads of its map.
        agents: The agents, already drawn.

    Returns:
        The agents, the first one with the edges of its route, and the route with the rules of the drive.

    Raises:
        InputError: The route is too short, or leads over no lanes.
    """
    if (drive := scenario.drive) is None:
        return agents, None
    ego = agents.vehicles[0]
    try:
        path, edges = _draw_path(scenario, drive, seed, network, ego)
    except ValueError as error:
        raise InputError(f"{scenario.where('drive', 'route')}: {error} in map {network.name}") from None
    route = route_spec(path)
    if route.length_m < _MIN_ROUTE_M:
        raise InputError(
            f"{scenario.where('drive', 'route')}: is {route.length_m:.1f} m long in map {network.name}; "
            f"at least {_MIN_ROUTE_M:g} m is needed"
        )
    spec = DriveSpec(route=route, **drive.model_dump(include={*DriveSpec.model_fields} - {"route", "events"}))
    return agents._replace(vehicles=(ego.model_copy(update={"via": edges[1:]}), *agents.vehicles[1:])), spec


def _draw_path(
    scenario: Scenario, drive: Drive, seed: int, network: RoadNetwork, ego: VehicleSpec
) -> tuple[LanePath, tuple[str, ...]]:
    """The path from the center of the vehicle to the goal, and its edges, with the one behind a last junction."""
    blueprint, start = blueprint_named(ego.blueprint), network.lanes[ego.start.lane]
    paths, graph = LanePaths(network, blueprint.sumo_class), streets_of(network).for_blueprint(blueprint)
    from_m = max(ego.start.s_m - blueprint.size_m[0] / 2.0, 0.0)
    edges = route_through(graph, start.edge, ego.via)
    if drive.points_on(network.name)[1]:
        goal = _goal(scenario, network, blueprint)
        if edges[-1] != goal[0].edge or (len(edges) == 1 and goal[1] <= from_m):
            raise ValueError("the goal is behind the start on the same road")
        return paths.path_along(edges, (start, from_m), goal), edges
    length_m = sample(drive.goal_m, stream(seed, "drive.goal"))
    rng = stream(seed, "drive.route")
    if ego.via:
        edges = (*edges, *graph.draw_continuation(edges[-1], length_m, rng))
    else:
        edges = graph.draw_route(start.id, length_m + from_m, rng)
    whole = paths.path_along(edges, (start, from_m), None)
    path = _cut(whole, length_m)
    if (found_m := route_spec(path).length_m) < length_m - 1.0:
        _LOGGER.warning("%s: route of %.0f m, not %.0f m: no road leads further", network.name, found_m, length_m)
    return path, whole.edges[: len(path.edges) + bool(path.lanes[-1].junction)]


def _goal(scenario: Scenario, network: RoadNetwork, blueprint: Blueprint) -> tuple[Lane, float]:
    """Lane of the last point of a configured route, and the distance from its start."""
    ego, where = routed_ego(scenario, network)
    _, poses = ego.route_on(network.name)
    (goal,) = spawn_starts(poses[-1:], blueprint, network, lambda *_: where("route", len(poses) - 1))
    return network.lanes[goal.lane], max(goal.s_m - blueprint.size_m[0] / 2.0, 0.0)


def _distances_m(points_m: Float64Array) -> Float64Array:
    """(N,) distances in plan view from the first of (N, 3) points along their line."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points_m[:, :2], axis=0), axis=1))])


def _cut(path: LanePath, length_m: float) -> LanePath:
    """The first ``length_m`` of a path."""
    distance_m = _distances_m(path.points_m)
    count = int(np.searchsorted(distance_m, length_m - 1e-3))
    if count >= len(distance_m):
        return path
    goal_m = [np.interp(length_m, distance_m, path.points_m[:, axis]) for axis in range(3)]
    points_m = np.concatenate([path.points_m[:count], [goal_m]])
    return LanePath(points_m, path.lanes[: count + 1], path.commands[: count + 1])


def route_spec(path: LanePath) -> RouteSpec:
    """A path as it is stored in a scene, to the millimeter."""
    points_m = path.points_m.round(3)
    x_m, y_m, z_m = (tuple(column) for column in points_m.T.tolist())
    return RouteSpec(
        x_m=x_m,
        y_m=y_m,
        z_m=z_m,
        distance_m=tuple(_distances_m(points_m).round(4).tolist()),
        limit_mps=tuple(round(lane.speed_mps, 3) for lane in path.lanes),
        lane=tuple(lane.id for lane in path.lanes),
        command=path.commands,
    )
