"""Splits elevated roads into bridges and stretches on the ground, after their heights are known."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.plan.heights.profile import Land
from simbev_ros.maps.plan.lines import part, stations_m
from simbev_ros.maps.plan.plan import Link, Plan

_MIN_BRIDGE_HEIGHT_M = 3.0
_MIN_PIECE_M = 20.0


def split_structures(plan: Plan, land: Land) -> Plan:
    """Split elevated links where their height above the land starts or ceases to require a bridge."""
    nodes_m, links = list(plan.nodes_m), []
    for link in plan.links:
        pieces = list(_pieces(link, land)) if link.road.elevated_m > 0.0 else [(0.0, np.inf, False)]
        cut_nodes = [link.start]
        for start_m, _, _ in pieces[1:]:
            nodes_m.append(part(link.line_m, start_m, start_m + 1.0)[0])
            cut_nodes.append(len(nodes_m) - 1)
        cut_nodes.append(link.end)
        for number, (start_m, end_m, structure) in enumerate(pieces):
            links.append(
                replace(
                    link,
                    id=link.id if len(pieces) == 1 else f"{link.id}+{number}",
                    start=cut_nodes[number],
                    end=cut_nodes[number + 1],
                    line_m=link.line_m if len(pieces) == 1 else part(link.line_m, start_m, end_m),
                    structure=structure,
                )
            )
    return Plan(np.array(nodes_m), tuple(links), plan.notes)


def _pieces(link: Link, land: Land) -> Iterator[tuple[float, float, bool]]:
    """Stretches of a link, each at least 20 m long: start, end, and whether it is a bridge."""
    along_m: Float64Array = stations_m(link.line_m)
    needs_bridge = link.line_m[:, 2] - land(link.line_m[:, :2]) > _MIN_BRIDGE_HEIGHT_M
    changes = np.flatnonzero(np.diff(needs_bridge)) + 1
    bounds = [0.0]
    for station_m in along_m[changes]:
        if station_m - bounds[-1] >= _MIN_PIECE_M and along_m[-1] - station_m >= _MIN_PIECE_M:
            bounds.append(float(station_m))
    bounds.append(float(along_m[-1]))
    for start_m, end_m in pairwise(bounds):
        inside = (along_m >= start_m) & (along_m <= end_m)
        yield start_m, end_m, bool(np.mean(needs_bridge[inside]) > 0.5)
