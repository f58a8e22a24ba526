"""Constrains the heights near each node to a plane, so that junctions are even and their roads meet at one height."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.plan.heights.vertices import Vertices, max_grade_of
from simbev_ros.maps.plan.plan import Plan, half_width_m, heading_from

NODE_UNKNOWNS = 3
"""Number of unknowns per node: height, and gradient along x and along y."""

_MAX_RISE_M = 0.12  # netconvert levels junctions in which roads rise by more than this
_MAX_CROSSFALL = 0.002  # small, because ramps begin beside the lanes that they leave, at equal height
_THROUGH_REACH_M = 4.0
_PARALLEL_SINE = 0.35
_MIN_SINE = 0.5
_MAX_LINK_FRACTION = 0.35


@dataclass(frozen=True, slots=True)
class Planes:
    """One plane per node.

    Attributes:
        reach_m: (K,) distance from the node along its links up to which the plane applies.
        axis: (K, 2) unit vector: the direction of one of its roads.
        along: (K,) maximum gradient along the axis.
        across: (K,) maximum gradient perpendicular to the axis.
    """

    reach_m: Float64Array
    axis: Float64Array
    along: Float64Array
    across: Float64Array


def planes_of(plan: Plan) -> Planes:
    """The planes at the nodes of a plan, without heights yet."""
    count = len(plan.nodes_m)
    planes = Planes(np.empty(count), np.empty((count, 2)), np.empty(count), np.empty(count))
    for node, links in enumerate(plan.links_at()):
        headings = np.array([heading_from(link, node) for link in links])
        planes.axis[node] = headings[0]
        if _is_through(headings):
            planes.reach_m[node] = _THROUGH_REACH_M
            planes.along[node] = min(max_grade_of(link.road.kind) for link in links)
            planes.across[node] = _MAX_CROSSFALL
        else:
            # The extent of netconvert's junctions, which is larger where roads meet at a sharp angle.
            cosine = np.max((headings @ headings.T)[~np.eye(len(headings), dtype=bool)], initial=0.0)
            widest_m = max(half_width_m(link.road.kind) + link.road.kind.corner_radius_m for link in links)
            planes.reach_m[node] = widest_m / max(np.sqrt(1.0 - cosine**2), _MIN_SINE) + 2.0
            planes.along[node] = planes.across[node] = _MAX_RISE_M / planes.reach_m[node]
    return planes


def _is_through(headings: Float64Array) -> bool:
    """Whether all roads run in nearly one direction, as at bends, merges and changes of width."""
    return bool(np.all(np.abs(headings[:, 0] * headings[0, 1] - headings[:, 1] * headings[0, 0]) < _PARALLEL_SINE))


def heights_from_unknowns(plan: Plan, vertices: Vertices, reach_m: Float64Array) -> csr_array:
    """(M, U) matrix: heights of vertices from height and gradient of each node, then heights of free vertices.

    A road that joins others beside their line has the node's height at its own end, so that adjacent lanes are level.
    """
    ends = np.array([(link.start, link.end) for link in plan.links])[vertices.link]
    max_reach_m = _MAX_LINK_FRACTION * (vertices.station_m + vertices.to_end_m)
    near_start = vertices.station_m <= np.minimum(reach_m[ends[:, 0]], max_reach_m)
    near_end = vertices.to_end_m <= np.minimum(reach_m[ends[:, 1]], max_reach_m)
    is_bound = np.flatnonzero(near_start | near_end)
    free = np.flatnonzero(~(near_start | near_end))
    node = np.where(near_start, ends[:, 0], ends[:, 1])[is_bound]
    side = np.where(near_start, 0, 1)[is_bound]
    joins = np.array([[join is not None for join in link.road.joins_m] for link in plan.links])
    own_ends_m = np.array([(link.line_m[0], link.line_m[-1]) for link in plan.links])
    link = vertices.link[is_bound]
    anchor_m = np.where(joins[link, side, None], own_ends_m[link, side], plan.nodes_m[node])
    from_node_m = vertices.xy_m[is_bound] - anchor_m
    nodes_end = NODE_UNKNOWNS * len(plan.nodes_m)
    row = np.concatenate([np.repeat(is_bound, NODE_UNKNOWNS), free])
    of_nodes = (NODE_UNKNOWNS * node[:, None] + np.arange(NODE_UNKNOWNS)).ravel()
    column = np.concatenate([of_nodes, nodes_end + np.arange(len(free))])
    value = np.concatenate([np.column_stack([np.ones(len(is_bound)), from_node_m]).ravel(), np.ones(len(free))])
    return csr_array(coo_array((value, (row, column)), shape=(len(vertices), nodes_end + len(free))))
