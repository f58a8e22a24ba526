"""Keep SUMO's traffic off the lanes that hazard areas close: obstacles on the lanes and lower speed limits."""

from collections.abc import Iterable, Mapping
from xml.etree import ElementTree

from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.schema.scene.hazard import BlockedStretch
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.world.sumo.libsumo_import import libsumo
from simbev_ros.simulation.world.sumo.tracks import LaneTracks

CLOSURE = "o"
"""Prefix of the obstacles' names; a number follows."""

_SPEED_FACTOR = 0.6  # speed limit past an area divided by the usual one
_SLOW_APPROACH_M = 100.0
_FOREVER_S = "1e8"
_ASSERTIVE = "3"  # factor by which accepted gaps shrink
_NO_RETURN_M = 5.0  # distance behind the area without lane changes, so that the rears of long vehicles clear it
_SIDE_MARGIN_M = 0.2  # free width of the lane on each side of an obstacle
_QUEUE_GAP_M, _STANDING_MPS = 5.0, 0.05
_MIN_GAP_M = 0.05  # to a closure, beyond minGap
_SHORTENING_M, _MAX_SHORTENING_M = 1.0, 4.0  # per call, and in all
_STOP_M = 0.1  # from departure to stop; SUMO does not let a vehicle stop where it departs


def add_closures(root: ElementTree.Element, spec: SceneSpec, network: RoadNetwork) -> set[str]:
    """Add an obstacle, as long as its area, to every closed lane of a passable road; returns the edges with obstacles.

    For SUMO the obstacle is a vehicle that has stopped for good. Drivers change lanes from 100 m ahead of it, and
    accept smaller gaps than usual, because drivers in queues side by side would otherwise wait for each other forever.
    """
    stretches = _passable_stretches(spec)
    edges = {network.lanes[stretch.lane].edge for stretch in stretches}
    for driver in root.iter("vType") if stretches else ():
        driver.set("lcAssertive", _ASSERTIVE)
    tracks = LaneTracks([lane for lane in network.lanes.values() if lane.edge in edges])
    for number, stretch in enumerate(stretches):
        lane = network.lanes[stretch.lane]
        to_s_m = min(stretch.to_s_m + _NO_RETURN_M, lane.length_m - _STOP_M)
        from_m, to_m = (tracks.sumo_position_m(lane.id, s_m) for s_m in (stretch.from_s_m, to_s_m))
        name = f"{CLOSURE}{number}"
        size = {"length": repr(to_m - from_m), "width": repr(lane.width_m - 2.0 * _SIDE_MARGIN_M), "minGap": "0"}
        ElementTree.SubElement(root, "vType", {"id": name, "vClass": "ignoring", **size})
        start = {"depart": "0", "departLane": lane.id.rsplit("_", 1)[1], "departPos": repr(to_m), "departSpeed": "0"}
        element = ElementTree.SubElement(
            root, "vehicle", {"id": name, "type": name, "insertionChecks": "none", **start}
        )
        ElementTree.SubElement(element, "route", {"edges": lane.edge})
        ElementTree.SubElement(
            element, "stop", {"lane": lane.id, "endPos": repr(to_m + _STOP_M), "duration": _FOREVER_S}
        )
    return edges


def slow_near_closures(speeds_mps: Mapping[str, float], spec: SceneSpec, lanes: Iterable[Lane]) -> dict[str, float]:
    """Speed limits of lanes, reduced on edges with closed lanes and on those that lead to them.

    Args:
        speeds_mps: Lane id → speed limit in m/s that replaces the network's.
        spec: The scene.
        lanes: Lanes of the simulated edges.
    """
    by_id = {lane.id: lane for lane in lanes}
    closed = {stretch.lane: stretch for stretch in _passable_stretches(spec) if stretch.lane in by_id}
    ahead_m = {by_id[name].edge: stretch.from_s_m for name, stretch in closed.items()}
    pending = list(ahead_m)
    while pending:
        edge = pending.pop()
        for lane in by_id.values():
            leads = any(by_id[each].edge == edge for each in lane.successors if each in by_id)
            if leads and lane.edge not in ahead_m and ahead_m[edge] < _SLOW_APPROACH_M:
                ahead_m[lane.edge] = ahead_m[edge] + lane.length_m
                pending.append(lane.edge)
    near = {lane.id: _SPEED_FACTOR * lane.speed_mps for lane in by_id.values() if lane.edge in ahead_m}
    return {**speeds_mps, **{name: min(speed, speeds_mps.get(name, speed)) for name, speed in near.items()}}


def shorten_closure(name: str, full_length_m: float) -> None:
    """Shorten an obstacle a little, which had a length at first, if a vehicle waits close behind it."""
    follower, gap_m = libsumo.vehicle.getFollower(name, _QUEUE_GAP_M)
    length_m = libsumo.vehicle.getLength(name)
    stands = follower and gap_m < _MIN_GAP_M and libsumo.vehicle.getSpeed(follower) < _STANDING_MPS
    if stands and length_m > full_length_m - _MAX_SHORTENING_M:
        libsumo.vehicle.setLength(name, length_m - _SHORTENING_M)


def _passable_stretches(spec: SceneSpec) -> list[BlockedStretch]:
    """The blocked stretches with open lanes next to them."""
    return [stretch for hazard in spec.hazards if not hazard.closed_edges for stretch in hazard.blocked]
