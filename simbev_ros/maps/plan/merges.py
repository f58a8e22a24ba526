"""Prescribes lane connections where one-way roads widen, merge and split, because netconvert may cross them over."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from simbev_ros.maps.plan.lines import length_m, points_at
from simbev_ros.maps.plan.plan import Link, heading_from

_LOOKAHEAD_M = 8.0


class LanePair(NamedTuple):
    """A driving lane and the driving lane that follows it, counted from the right of each link's driving lanes."""

    incoming: str
    incoming_lane: int
    outgoing: str
    outgoing_lane: int


def lane_pairs(node: int, links: Sequence[Link]) -> Iterator[LanePair]:
    """Yield pairs of consecutive lanes at a node of one-way roads.

    Only nodes with as many lanes before as after, or with new lanes, are handled; other nodes yield nothing. New lanes
    begin on the right, without a predecessor: vehicles change over to them as to any other lane. A predecessor within
    the node would shift vehicles sideways by a lane's width within a meter.
    """
    incoming = _from_right_to_left(node, [link for link in links if link.end == node])
    outgoing = _from_right_to_left(node, [link for link in links if link.start == node])
    if (
        not incoming
        or not outgoing
        or not all(link.road.kind.one_way for link in links)
        or len(incoming) * len(outgoing) > 2
    ):
        return
    before, after = (
        [(link.id, lane) for link in side for lane in range(link.road.kind.lanes)] for side in (incoming, outgoing)
    )
    num_new = len(after) - len(before)
    if num_new == 0 or (num_new > 0 and len(links) == 2):
        for incoming_lane, outgoing_lane in zip(before, after[num_new:], strict=True):
            yield LanePair(*incoming_lane, *outgoing_lane)


def _from_right_to_left(node: int, links: list[Link]) -> list[Link]:
    """Links that all enter a node, or all leave it, in the order in which they lie side by side there."""
    if len(links) < 2:
        return links
    away = -heading_from(links[0], node) if links[0].end == node else heading_from(links[0], node)
    right = np.array([away[1], -away[0]])

    def offset_m(link: Link) -> float:
        whole_m = length_m(link.line_m)
        beside_m = min(_LOOKAHEAD_M, whole_m)
        at_m = whole_m - beside_m if link.end == node else beside_m
        return float(points_at(link.line_m[:, :2], np.array([at_m]))[0] @ right)

    return sorted(links, key=offset_m, reverse=True)
