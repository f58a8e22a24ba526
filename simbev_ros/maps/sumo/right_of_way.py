"""Determines which approaches to junctions without traffic lights must give way or stop."""

from collections import defaultdict

from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import SignKind
from simbev_ros.maps.sumo.net import SumoNet

_MAJOR, _YIELDS, _STOPS = frozenset("M"), frozenset("m"), frozenset("sw")


def minor_approaches(net: SumoNet) -> dict[str, SignKind]:
    """Edge → its sign, STOP or YIELD, for each edge without any movement that has right of way; in the net's order.

    An edge that yields only when turning left against oncoming traffic has other movements with right of way, and is
    not included.
    """
    codes: dict[str, set[str]] = defaultdict(set)
    for lane_id, lane_codes in net.right_of_way.items():
        if net.lanes[lane_id].kind is LaneKind.DRIVING:
            codes[net.lanes[lane_id].edge] |= lane_codes
    approaches: dict[str, SignKind] = {}
    for edge, edge_codes in codes.items():
        if edge_codes & _STOPS:
            approaches[edge] = SignKind.STOP
        elif edge_codes & _YIELDS and not edge_codes & _MAJOR:
            approaches[edge] = SignKind.YIELD
    return approaches
