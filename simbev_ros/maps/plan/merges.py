"""Which lane leads to which where one-way roads widen, merge and part; left alone, netconvert may cross them over."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from simbev_ros.maps.plan.lines import at_stations, length_m
from simbev_ros.maps.plan.plan import Link, heading_from

_LOOK_M = 8.0


class LanePair(NamedTuple):
    """Driving lanes that follow each other; lanes count from the right of their link's driving lanes."""

    coming: str
    coming_lane: int
    going: str
    going_lane: int


def lane_pairs(node: int, links: Sequence[Link]) -> Iterator[LanePair]:
    """Lanes that follow each other at a node of one-way roads, as many before it as after, or with lanes that begin.

    New lanes begin on the right, with no lane before them: vehicles change over to them as to any other lane, where one
    that led there within the node would take them a lane's width aside in a metre. Nothing is said of other nodes.
    """
    coming = _from_right_to_left(node, [link for link in links if link.end == node])
    going = _from_right_to_left(node, [link for link in links if link.start == node])
    if not coming or not going or not all(link.road.kind.one_way for link in links) or len(coming) * len(going) > 2:
        return
    before, after = (
        [(link.id, lane) for link in side for lane in range(link.road.kind.lanes)] for side in (coming, going)
    )
    more = len(after) - len(before)
    if more == 0 or (more > 0 and len(links) == 2):
        for coming_lane, going_lane in zip(before, after[more:], strict=True):
            yield LanePair(*coming_lane, *going_lane)


def _from_right_to_left(node: int, links: list[Link]) -> list[Link]:
    """Links that all come to a node, or all leave it, in the order in which they lie side by side there."""
    if len(links) < 2:
        return links
    away = -heading_from(links[0], node) if links[0].end == node else heading_from(links[0], node)
    right = np.array([away[1], -away[0]])

    def offset_m(link: Link) -> float:
        whole_m = length_m(link.line_m)
        beside_m = min(_LOOK_M, whole_m)
        at_m = whole_m - beside_m if link.end == node else beside_m
        return float(at_stations(link.line_m[:, :2], np.array([at_m]))[0] @ right)

    return sorted(links, key=offset_m, reverse=True)
