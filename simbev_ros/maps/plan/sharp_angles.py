"""Roads that leave a node at too sharp an angle are bent, so that their lanes part soon."""

from dataclasses import replace

import numpy as np

from simbev_ros.maps.plan.curves import heading, joining
from simbev_ros.maps.plan.lines import at_stations, length_m, part
from simbev_ros.maps.plan.plan import Link, Plan, heading_from
from simbev_ros.types import Float64Array

_SHARPEST_RAD = np.radians(48.0)
_BENT_RAD = np.radians(65.0)
_REACH_M = 40.0


def with_wide_angles(plan: Plan) -> Plan:
    """The plan with the lesser of two two-way roads bent wherever the angle between both is sharp."""
    links = {link.id: link for link in plan.links}
    for node, touching in enumerate(plan.links_at()):
        arms = [links[link.id] for link in touching if not link.road.kind.one_way and link.start != link.end]
        order = sorted(arms, key=lambda link: (-link.road.kind.priority, link.id))
        for index, arm in enumerate(order):
            headings = [heading_from(links[other.id], node) for other in order[:index]]
            bent = _bent(arm, node, headings)
            if bent is not None:
                links[arm.id] = bent
    return replace(plan, links=tuple(links.values()))


def _bent(link: Link, node: int, others: list[Float64Array]) -> Link | None:
    """The link turned away from the nearest of other directions; None where that is not needed or cannot be done."""
    away = heading_from(link, node)
    turns_rad = [float(np.arctan2(away[1] * o[0] - away[0] * o[1], away @ o)) for o in others]
    sharp = [turn for turn in turns_rad if abs(turn) < _SHARPEST_RAD]
    if not sharp or length_m(link.line_m) < 1.5 * _REACH_M:
        return None
    nearest = min(sharp, key=abs)
    more_rad = np.copysign(_BENT_RAD, nearest) - nearest
    cosine, sine = np.cos(more_rad), np.sin(more_rad)
    wanted = np.array([cosine * away[0] - sine * away[1], sine * away[0] + cosine * away[1]])
    line_m = link.line_m if link.start == node else link.line_m[::-1]
    joint_m = at_stations(line_m, np.array([_REACH_M]))[0]
    curve_m = joining(line_m[0], wanted, joint_m, heading(line_m, _REACH_M))
    line_m = np.concatenate([curve_m[:-1], part(line_m, _REACH_M, length_m(line_m))])
    return replace(link, line_m=line_m if link.start == node else line_m[::-1])
