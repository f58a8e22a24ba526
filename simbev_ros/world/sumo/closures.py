"""What keeps SUMO's traffic off the lanes that hazard areas close."""

from collections.abc import Iterable, Mapping
from xml.etree import ElementTree

from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.scene.hazards.hazard import BlockedStretch
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.world.sumo.tracks import Tracks

CLOSURE = "o"
"""Names of obstacles start so; a number follows."""

_SLOWER = 0.6  # speed limit past an area, over the usual one
_SLOWER_FROM_M = 100.0
_FOREVER_S = "1e8"
_ASSERTIVE = "3"  # accepted gaps are so many times smaller
_BEYOND_M = 5.0  # so far behind the area nobody changes back, for the sake of long vehicles' rears
_BARE_M = 0.2  # of the lane, on each side of an obstacle
_STOP_M = 0.1  # ahead of where it departs; SUMO lets nobody stop where it stands


def add_closures(root: ElementTree.Element, spec: SceneSpec, network: RoadNetwork) -> set[str]:
    """Let an obstacle as long as its area stand on every lane that is closed; the edges.

    For SUMO it is a vehicle that has stopped for good: drivers change lanes from 100 m ahead of it, and squeeze into
    smaller gaps than usual, since in queues side by side they would wait for each other for ever.
    """
    stretches = _passed(spec)
    edges = {network.lanes[stretch.lane].edge for stretch in stretches}
    for driver in root.iter("vType") if stretches else ():
        driver.set("lcAssertive", _ASSERTIVE)
    tracks = Tracks([lane for lane in network.lanes.values() if lane.edge in edges])
    for number, stretch in enumerate(stretches):
        lane = network.lanes[stretch.lane]
        to_s_m = min(stretch.to_s_m + _BEYOND_M, lane.length_m - _STOP_M)
        from_m, to_m = (tracks.sumo_position_m(lane.id, s_m) for s_m in (stretch.from_s_m, to_s_m))
        name = f"{CLOSURE}{number}"
        size = {"length": repr(to_m - from_m), "width": repr(lane.width_m - 2.0 * _BARE_M), "minGap": "0"}
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


def with_closures(speeds_mps: Mapping[str, float], spec: SceneSpec, lanes: Iterable[Lane]) -> dict[str, float]:
    """Speeds of lanes, lower on the streets with closed lanes and on those that lead to them.

    Args:
        speeds_mps: Lane id → speed limit in m/s that takes the place of the net's.
        spec: The scene.
        lanes: Of the streets that are simulated.
    """
    by_id = {lane.id: lane for lane in lanes}
    closed = {stretch.lane: stretch for stretch in _passed(spec) if stretch.lane in by_id}
    ahead_m = {by_id[name].edge: stretch.from_s_m for name, stretch in closed.items()}
    waiting = list(ahead_m)
    while waiting:
        edge = waiting.pop()
        for lane in by_id.values():
            leads = any(by_id[each].edge == edge for each in lane.successors if each in by_id)
            if leads and lane.edge not in ahead_m and ahead_m[edge] < _SLOWER_FROM_M:
                ahead_m[lane.edge] = ahead_m[edge] + lane.length_m
                waiting.append(lane.edge)
    near = {lane.id: _SLOWER * lane.speed_mps for lane in by_id.values() if lane.edge in ahead_m}
    return {**speeds_mps, **{name: min(speed, speeds_mps.get(name, speed)) for name, speed in near.items()}}


def _passed(spec: SceneSpec) -> list[BlockedStretch]:
    """The stretches beside which lanes stay open."""
    return [stretch for hazard in spec.hazards if not hazard.closed_edges for stretch in hazard.blocked]
