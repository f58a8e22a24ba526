"""Lets vehicles leave their lane for the one beside."""

from simbev_ros.simulation.world.sumo.libsumo_import import libsumo

_CHANGE_S = 5.0


def leave_lane(name: str) -> bool:
    """Let a vehicle change lanes within some seconds; returns whether its edge has another lane for it."""
    lane = _other_lane(name)
    if lane is not None:
        libsumo.vehicle.changeLane(name, lane, _CHANGE_S)
    return lane is not None


def _other_lane(name: str) -> int | None:
    """Index of the lane beside that of a vehicle, to the right if there is one; None: no lane is open to it."""
    edge, _, index = libsumo.vehicle.getLaneID(name).rpartition("_")
    if not edge or edge.startswith(":"):
        return None
    beside = (int(index) - 1, int(index) + 1)
    count, kind = libsumo.edge.getLaneNumber(edge), libsumo.vehicle.getVehicleClass(name)
    return next((lane for lane in beside if 0 <= lane < count and _is_open(f"{edge}_{lane}", kind)), None)


def _is_open(lane: str, kind: str) -> bool:
    """Whether vehicles of a class may use a lane."""
    allowed = libsumo.lane.getAllowed(lane)
    return kind in allowed if allowed else kind not in libsumo.lane.getDisallowed(lane)
