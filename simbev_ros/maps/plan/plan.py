"""A plan of roads: nodes where roads meet, and links between them."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.plan.draft import DraftRoad, RoadClass

_HEADING_REACH_M = 15.0  # a link's heading at a node is measured over this length


@dataclass(frozen=True, slots=True)
class Link:
    """A road, or a part of one, between two nodes.

    Attributes:
        id: Unique in its plan.
        road: The road that it is a part of.
        start: Index of the node at its start.
        end: Index of the node at its end.
        line_m: (N, 2) plan view; (N, 3) once it has heights. Its ends lie near the nodes, not always on them.
        structure: Carried by a bridge although nothing passes below.
    """

    id: str
    road: DraftRoad
    start: int
    end: int
    line_m: Float64Array
    structure: bool = False


@dataclass(frozen=True, slots=True)
class Plan:
    """A road plan.

    Attributes:
        nodes_m: (K, 2) positions of nodes; (K, 3) once they have heights.
        links: Links between nodes.
        notes: Changes to the roads, for the user.
    """

    nodes_m: Float64Array
    links: tuple[Link, ...]
    notes: tuple[str, ...] = ()

    def links_at(self) -> list[list[Link]]:
        """Links that touch each node; a link that starts and ends there is listed twice."""
        touching: list[list[Link]] = [[] for _ in self.nodes_m]
        for link in self.links:
            touching[link.start].append(link)
            touching[link.end].append(link)
        return touching


def half_width_m(kind: RoadClass) -> float:
    """Distance from the road's line to its outermost edge."""
    side_m = kind.sidewalk_m + kind.parking_m + kind.bicycle_m + kind.shoulder_m + kind.lanes * kind.lane_width_m
    if not kind.one_way:
        return side_m + kind.median_m / 2.0
    return side_m if kind.line_at == "left" else side_m - kind.lanes * kind.lane_width_m / 2.0


def heading_from(link: Link, node: int) -> Float64Array:
    """(2,) unit vector in which a link leaves a node, measured over its first meters."""
    line_m = link.line_m[:, :2] if link.start == node else link.line_m[::-1, :2]
    away_m = np.linalg.norm(line_m - line_m[0], axis=1)
    reached = int(np.argmax(away_m >= _HEADING_REACH_M)) if np.any(away_m >= _HEADING_REACH_M) else len(line_m) - 1
    step_m = line_m[reached] - line_m[0]
    return step_m / np.linalg.norm(step_m)
