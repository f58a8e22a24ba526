"""Bends roads that leave a node of a plan at too sharp an angle, so that their lanes separate soon."""

from dataclasses import replace

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.plan.curves import bezier_between, heading_at
from simbev_ros.maps.plan.lines import length_m, part, points_at
from simbev_ros.maps.plan.plan import Link, Plan, heading_from

_MIN_ANGLE_RAD = np.radians(48.0)
_WIDENED_ANGLE_RAD = np.radians(65.0)
_BEND_LENGTH_M = 40.0


def widen_sharp_angles(plan: Plan) -> Plan:
    """Bend the lower-priority one of two two-way roads wherever the angle between them is sharp."""
    links = {link.id: link for link in plan.links}
    for node, touching in enumerate(plan.links_at()):
        arms = [links[link.id] for link in touching if not link.road.kind.one_way and link.start != link.end]
        order = sorted(arms, key=lambda link: (-link.road.kind.priority, link.id))
        for index, arm in enumerate(order):
            headings = [heading_from(links[other.id], node) for other in order[:index]]
            bent_link = _bend_away(arm, node, headings)
            if bent_link is not None:
                links[arm.id] = bent_link
    return replace(plan, links=tuple(links.values()))


def _bend_away(link: Link, node: int, others: list[Float64Array]) -> Link | None:
    """The link turned away from the closest of other directions; None if that is not necessary or not possible."""
    away = heading_from(link, node)
    turns_rad = [float(np.arctan2(away[1] * o[0] - away[0] * o[1], away @ o)) for o in others]
    sharp = [turn for turn in turns_rad if abs(turn) < _MIN_ANGLE_RAD]
    if not sharp or length_m(link.line_m) < 1.5 * _BEND_LENGTH_M:
        return None
    nearest = min(sharp, key=abs)
    turn_rad = np.copysign(_WIDENED_ANGLE_RAD, nearest) - nearest
    cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
    new_heading = np.array([cosine * away[0] - sine * away[1], sine * away[0] + cosine * away[1]])
    line_m = link.line_m if link.start == node else link.line_m[::-1]
    joint_m = points_at(line_m, np.array([_BEND_LENGTH_M]))[0]
    curve_m = bezier_between(line_m[0], new_heading, joint_m, heading_at(line_m, _BEND_LENGTH_M))
    line_m = np.concatenate([curve_m[:-1], part(line_m, _BEND_LENGTH_M, length_m(line_m))])
    return replace(link, line_m=line_m if link.start == node else line_m[::-1])
