"""The first route of each vehicle of a scene, which follows from the specification alone, and its line on the map."""

from typing import NamedTuple

import numpy as np

from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.network import Lane, RoadNetwork, paths_beyond
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.streets.street_graph import StreetGraph
from simbev_ros.scene.streets.streets import streets_of
from simbev_ros.schema.scene.spec import SceneSpec


class VehicleRoute(NamedTuple):
    """Ids of the edges along which a vehicle drives, and whether the last one is a dead end."""

    edges: tuple[str, ...]
    ends: bool


def draw_vehicle_route(spec: SceneSpec, network: RoadNetwork, index: int) -> VehicleRoute:
    """Draw the route with which a vehicle enters the simulation; it suffices for the scene, and is extended later.

    Args:
        spec: The scene.
        network: The roads of its map.
        index: Index of the vehicle in the specification.

    Raises:
        SimulationError: The vehicle starts where its class may not drive.
    """
    vehicle = spec.vehicles[index]
    blueprint = blueprint_named(vehicle.blueprint)
    max_speed_mps = min(network.max_speed_mps * vehicle.speed_factor, blueprint.max_speed_mps)
    streets = streets_of(network)
    graph = streets.for_blueprint(blueprint, spec.closed_edges)
    if not graph.has_successor(vehicle.start.lane):  # a start set by hand: drive on, however tight the turns
        graph = streets.for_blueprint(blueprint, spec.closed_edges, tight=True)
    rng = stream(spec.seed, f"v{index}.route")
    length_m = duration_s(spec) * max_speed_mps
    if vehicle.via:
        edges = route_through(graph, network.lanes[vehicle.start.lane].edge, vehicle.via)
        edges += graph.draw_continuation(edges[-1], length_m, rng)
    else:
        edges = graph.draw_route(vehicle.start.lane, length_m, rng)
    return VehicleRoute(edges, graph.is_dead_end(edges[-1]))


def route_through(graph: StreetGraph, start: str, via: tuple[str, ...]) -> tuple[str, ...]:
    """An edge, and the shortest paths from each edge to the next one of those that a route passes."""
    edges = [start]
    for goal in via:
        edges += graph.shortest_path(edges[-1], goal)
    return tuple(edges)


def duration_s(spec: SceneSpec) -> float:
    """Duration of a scene with its warm-up."""
    return (spec.warm_up_ticks + spec.ticks) * spec.tick_ns / NS_PER_S


def route_line_m(spec: SceneSpec, network: RoadNetwork, index: int) -> Float64Array:
    """(N, 2) line of a vehicle's route, map frame, as far as it gets at its desired speed without waiting.

    Arguments and errors are those of ``draw_vehicle_route``.
    """
    vehicle = spec.vehicles[index]
    left_s, lane = duration_s(spec), network.lanes[vehicle.start.lane]
    parts, skipped_m = list[Float64Array](), vehicle.start.s_m
    for edge in (*draw_vehicle_route(spec, network, index).edges[1:], ""):
        path = _path_to(edge, lane, network)
        for each in (lane, *path[:-1]):
            line = _cut(each.centerline_m[:, :2], skipped_m, skipped_m + left_s * each.speed_mps * vehicle.speed_factor)
            left_s -= (each.length_m - skipped_m) / (each.speed_mps * vehicle.speed_factor)
            skipped_m = 0.0
            parts.append(line)
            if left_s <= 0.0:
                return np.concatenate(parts)
        if not path:
            break
        lane = path[-1]
    return np.concatenate(parts)


def _path_to(edge: str, lane: Lane, network: RoadNetwork) -> list[Lane]:
    """The lanes from a lane, or from an adjacent one, through a junction to an edge; empty if there are none."""
    beside = sorted(
        (other for other in network.lanes_of_edge(lane.edge) if other.kind is lane.kind),
        key=lambda other: abs(other.index - lane.index),
    )
    for start in beside:
        for path in paths_beyond(start, network.lanes):
            if network.lanes[path[-1]].edge == edge:
                return [network.lanes[name] for name in path]
    return []


def _cut(line_m: Float64Array, from_m: float, to_m: float) -> Float64Array:
    """(N, 2) part of a line between two distances from its start."""
    stations_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m, axis=0), axis=1))])
    ends_m = np.clip([from_m, to_m], 0.0, stations_m[-1])
    inside = stations_m[(stations_m > ends_m[0]) & (stations_m < ends_m[1])]
    at_m = np.concatenate([ends_m[:1], inside, ends_m[1:]])
    return np.column_stack([np.interp(at_m, stations_m, line_m[:, k]) for k in range(2)])
