"""Computes the heights of a plan: roads follow the land as closely as grades, vertical curves and clearances allow.

All heights are the solution of one quadratic program: as close to the target heights and as smooth as possible within
the limits.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, diags_array, vstack
from scipy.sparse.csgraph import dijkstra

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land_features import Water
from simbev_ros.maps.plan.heights.height_limits import Limits, bends_of, gradient_limits, limits_of
from simbev_ros.maps.plan.heights.node_planes import NODE_UNKNOWNS, heights_from_unknowns, planes_of
from simbev_ros.maps.plan.heights.quadratic import solve_qp
from simbev_ros.maps.plan.heights.vertices import Vertices, vertices_of
from simbev_ros.maps.plan.lines import densify, length_m
from simbev_ros.maps.plan.plan import Plan

_SMOOTHING_M = 20.0  # hills shorter than about six times this are smoothed out
_LAYER_WEIGHT = 0.02  # roads above or below others adapt, rather than roads on the ground
_ELEVATED_WEIGHT = 0.2
_GRADIENT_WEIGHT = 10.0
_APPROACH_GRADE = 0.035  # target grade at which elevated roads rise from the ground
_NOTED_VIOLATION = 0.05

Land = Callable[[Float64Array], Float64Array]
"""Function from (N, 2) points to (N,) heights of the land."""


def add_heights(plan: Plan, land: Land, water: Sequence[Water]) -> Plan:
    """Add heights to a plan; limits that are violated are noted.

    Returns:
        The plan with (N, 3) lines, with vertices at most 5 m apart, and (K, 3) nodes.
    """
    plan = replace(plan, links=tuple(replace(link, line_m=densify(link.line_m)) for link in plan.links))
    vertices = vertices_of(plan.links)
    planes = planes_of(plan)
    basis = heights_from_unknowns(plan, vertices, planes.reach_m)
    weight = _weight(vertices) * vertices.share_m
    bends, around_m = bends_of(vertices)
    bending_penalty = bends.T @ diags_array(_SMOOTHING_M**4 / around_m) @ bends
    gradient_penalty = np.zeros(basis.shape[1])
    gradient_penalty[: NODE_UNKNOWNS * len(plan.nodes_m)].reshape(-1, NODE_UNKNOWNS)[:, 1:] = _GRADIENT_WEIGHT
    limits = limits_of(plan, vertices, bends, water)
    blocks = [*(block.in_unknowns(basis) for block in limits), gradient_limits(planes, basis.shape[1])]
    unknowns = solve_qp(
        csc_array(basis.T @ (diags_array(weight) + bending_penalty) @ basis + diags_array(gradient_penalty)),
        basis.T @ (weight * (land(vertices.xy_m) + _target_height_above_land_m(plan, vertices))),
        csr_array(vstack([block.rows for block in blocks])),
        np.concatenate([block.low for block in blocks]),
        np.concatenate([block.high for block in blocks]),
    )
    height_m: Float64Array = basis @ unknowns
    notes = tuple(_notes(plan, vertices, limits, height_m))
    return replace(_apply_heights(plan, vertices, height_m, unknowns), notes=plan.notes + notes)


def _weight(vertices: Vertices) -> Float64Array:
    """(M,) weight of the deviation of each vertex from its target height."""
    on_ground = np.where(vertices.layer == 0, 1.0, _LAYER_WEIGHT)
    return np.where(vertices.elevated_m > 0.0, _ELEVATED_WEIGHT, on_ground)


def _target_height_above_land_m(plan: Plan, vertices: Vertices) -> Float64Array:
    """(M,) target heights above the land: elevated roads rise gradually from where they leave the ground."""
    ground_m = _distance_to_ground_m(plan)
    ends = np.array([(link.start, link.end) for link in plan.links])[vertices.link]
    distance_m = np.minimum(ground_m[ends[:, 0]] + vertices.station_m, ground_m[ends[:, 1]] + vertices.to_end_m)
    return np.minimum(vertices.elevated_m, _APPROACH_GRADE * distance_m)


def _distance_to_ground_m(plan: Plan) -> Float64Array:
    """(K,) distance along elevated roads to the nearest node of a road on the ground; inf if there is none."""
    count = len(plan.nodes_m)
    elevated = [link for link in plan.links if link.road.elevated_m > 0.0]
    ground = sorted({node for link in plan.links if link.road.elevated_m == 0.0 for node in (link.start, link.end)})
    if not elevated or not ground:
        return np.full(count, np.inf)
    ends = np.array([(link.start, link.end) for link in elevated])
    lengths_m = [length_m(link.line_m) for link in elevated]
    graph = csr_array(coo_array((lengths_m, (ends[:, 0], ends[:, 1])), shape=(count, count)))
    return dijkstra(graph, directed=False, indices=ground, min_only=True)


def _notes(plan: Plan, vertices: Vertices, limits: Sequence[Limits], height_m: Float64Array) -> Iterator[str]:
    """One sentence for each road and kind of limit that is violated."""
    for block in limits:
        missed = np.flatnonzero(block.violation(height_m) > _NOTED_VIOLATION)
        at = np.asarray(np.abs(block.rows[missed]).argmax(axis=1)).ravel() if len(missed) else missed
        links, first = np.unique(vertices.link[at], return_index=True)
        for link, vertex in zip(links, at[first], strict=True):
            x_m, y_m = vertices.xy_m[vertex]
            yield f"road {plan.links[link].id}: no room for {block.name} near ({x_m:.0f}, {y_m:.0f})"


def _apply_heights(plan: Plan, vertices: Vertices, height_m: Float64Array, unknowns: Float64Array) -> Plan:
    """The plan with these heights."""
    height_m = np.round(height_m, 3)
    links = tuple(
        replace(link, line_m=np.column_stack([link.line_m, height_m[vertices.first[i] : vertices.first[i + 1]]]))
        for i, link in enumerate(plan.links)
    )
    node_m = np.round(unknowns[: NODE_UNKNOWNS * len(plan.nodes_m) : NODE_UNKNOWNS], 3)
    return Plan(np.column_stack([plan.nodes_m, node_m]), links, plan.notes)
