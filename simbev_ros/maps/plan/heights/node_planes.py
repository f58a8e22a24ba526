"""Near a node all heights lie on one plane, so that junctions are even and their roads meet at one height."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array

from simbev_ros.maps.plan.heights.vertices import Vertices, largest_grade
from simbev_ros.maps.plan.plan import Plan, half_width_m, heading_from
from simbev_ros.types import Float64Array

NODE_UNKNOWNS = 3
"""Height, and gradient along x and along y."""

_RISE_M = 0.12  # netconvert makes junctions level whose roads rise more inside them
_CROSSFALL = 0.002  # ramps begin beside the lanes that they leave, at their height
_THROUGH_REACH_M = 4.0
_PARALLEL_SINE = 0.35
_SMALLEST_SINE = 0.5
_MOST_OF_LINK = 0.35


@dataclass(frozen=True, slots=True)
class Planes:
    """One plane at each node.

    Attributes:
        reach_m: (K,) how far it reaches along the node's links.
        axis: (K, 2) unit vector: the direction of one of its roads.
        along: (K,) largest gradient along the axis.
        across: (K,) largest gradient to its side.
    """

    reach_m: Float64Array
    axis: Float64Array
    along: Float64Array
    across: Float64Array


def planes_of(plan: Plan) -> Planes:
    """The planes at the nodes of a plan, still without heights."""
    count = len(plan.nodes_m)
    planes = Planes(np.empty(count), np.empty((count, 2)), np.empty(count), np.empty(count))
    for node, links in enumerate(plan.links_at()):
        ways = np.array([heading_from(link, node) for link in links])
        planes.axis[node] = ways[0]
        if _is_through(ways):
            planes.reach_m[node] = _THROUGH_REACH_M
            planes.along[node] = min(largest_grade(link.road.kind) for link in links)
            planes.across[node] = _CROSSFALL
        else:
            # As far as netconvert's junctions reach: further where roads meet at a sharp angle.
            cosine = np.max((ways @ ways.T)[~np.eye(len(ways), dtype=bool)], initial=0.0)
            widest_m = max(half_width_m(link.road.kind) + link.road.kind.corner_radius_m for link in links)
            planes.reach_m[node] = widest_m / max(np.sqrt(1.0 - cosine**2), _SMALLEST_SINE) + 2.0
            planes.along[node] = planes.across[node] = _RISE_M / planes.reach_m[node]
    return planes


def _is_through(ways: Float64Array) -> bool:
    """Whether all roads run in nearly one direction, as at bends, merges and changes of width."""
    return bool(np.all(np.abs(ways[:, 0] * ways[0, 1] - ways[:, 1] * ways[0, 0]) < _PARALLEL_SINE))


def heights_from_unknowns(plan: Plan, vertices: Vertices, reach_m: Float64Array) -> csr_array:
    """(M, U) matrix: heights of vertices from height and gradient of each node, then heights of free vertices.

    A road that joins others beside their line has the node's height at its own end: lanes side by side are level.
    """
    ends = np.array([(link.start, link.end) for link in plan.links])[vertices.link]
    most_m = _MOST_OF_LINK * (vertices.station_m + vertices.to_end_m)
    near_start = vertices.station_m <= np.minimum(reach_m[ends[:, 0]], most_m)
    near_end = vertices.to_end_m <= np.minimum(reach_m[ends[:, 1]], most_m)
    bound = np.flatnonzero(near_start | near_end)
    free = np.flatnonzero(~(near_start | near_end))
    node = np.where(near_start, ends[:, 0], ends[:, 1])[bound]
    side = np.where(near_start, 0, 1)[bound]
    joins = np.array([[join is not None for join in link.road.joins_m] for link in plan.links])
    own_ends_m = np.array([(link.line_m[0], link.line_m[-1]) for link in plan.links])
    link = vertices.link[bound]
    anchor_m = np.where(joins[link, side, None], own_ends_m[link, side], plan.nodes_m[node])
    from_node_m = vertices.xy_m[bound] - anchor_m
    nodes_end = NODE_UNKNOWNS * len(plan.nodes_m)
    row = np.concatenate([np.repeat(bound, NODE_UNKNOWNS), free])
    of_nodes = (NODE_UNKNOWNS * node[:, None] + np.arange(NODE_UNKNOWNS)).ravel()
    column = np.concatenate([of_nodes, nodes_end + np.arange(len(free))])
    value = np.concatenate([np.column_stack([np.ones(len(bound)), from_node_m]).ravel(), np.ones(len(free))])
    return csr_array(coo_array((value, (row, column)), shape=(len(vertices), nodes_end + len(free))))
