"""Routes of SUMO's vehicles: their ends, their continuation, and vehicles that wait in a lane outside their route."""

from collections.abc import Sequence

from simbev_ros.simulation.world.sumo.libsumo_import import libsumo

_MIN_EDGES_LEFT = 6  # with this number of edges left, a route is extended
_PATIENCE_S = 20.0  # time after which a driver who cannot get into the lane for a turn takes another route
_QUEUE_GAP_M = 5.0
_FOREVER_S = 1e8
_NOT_GREEN = "ryu"
_STANDING_MPS, _MAX_STOP_LINE_M = 0.05, 10.0


def ending_edge(name: str) -> str:
    """Id of the last edge of a vehicle's route if it ends soon, and not with a stop; otherwise ""."""
    route, index = libsumo.vehicle.getRoute(name), libsumo.vehicle.getRouteIndex(name)
    ends = len(route) - index <= _MIN_EDGES_LEFT and not libsumo.vehicle.getStops(name, 1)
    return str(route[-1]) if ends else ""


def extend_route(name: str, edges: Sequence[str], last_lane: str | None) -> None:
    """Append edges to a vehicle's route; with a ``last_lane`` it stops at that lane's end for good."""
    ahead = libsumo.vehicle.getRoute(name)[libsumo.vehicle.getRouteIndex(name) :]
    if edges:
        libsumo.vehicle.setRoute(name, [*ahead, *edges])
    if last_lane is not None:
        edge, lane = last_lane.rsplit("_", 1)
        libsumo.vehicle.setStop(name, edge, libsumo.lane.getLength(last_lane), int(lane), _FOREVER_S)


def replace_route(name: str, edges: Sequence[str], last_lane: str | None) -> None:
    """Let a vehicle drive along edges, the first one its own; with a ``last_lane`` it stops at that lane's end."""
    for _ in libsumo.vehicle.getStops(name):
        libsumo.vehicle.replaceStop(name, 0, "")
    libsumo.vehicle.setRoute(name, list(edges))
    extend_route(name, (), last_lane)


def stands_in_wrong_lane(name: str) -> bool:
    """Whether a vehicle has stood for long, and nothing keeps it but that its lane does not lead along its route.

    It is the first in its lane, and the light, if there is one, is green.
    """
    lane = libsumo.vehicle.getLaneID(name)
    if libsumo.vehicle.getWaitingTime(name) < _PATIENCE_S or libsumo.vehicle.getLeader(name, _QUEUE_GAP_M):
        return False
    if any(state in _NOT_GREEN for _, _, _, _, _, state, *_ in libsumo.vehicle.getNextLinks(name)[:1]):
        return False
    return any(other == lane and offset for other, _, _, offset, *_ in libsumo.vehicle.getBestLanes(name))


def will_stand(name: str, for_s: float) -> bool:
    """Whether a vehicle at rest will stay for this duration: in a queue, or at a red light that lasts as long."""
    leader = libsumo.vehicle.getLeader(name, _QUEUE_GAP_M)
    if leader and leader[1] < _QUEUE_GAP_M:
        return bool(libsumo.vehicle.getSpeed(leader[0]) < _STANDING_MPS)
    for light, _, distance_m, state in libsumo.vehicle.getNextTLS(name)[:1]:
        rest_s = libsumo.trafficlight.getNextSwitch(light) - libsumo.simulation.getTime()
        return bool(state == "r" and distance_m < _MAX_STOP_LINE_M and rest_s >= for_s)
    return False
