"""Motion that is given to SUMO's vehicles for a while, regardless of their drivers; vehicles are given by their row."""

from collections.abc import Sequence

from simbev_ros.simulation.world.sumo.libsumo_import import libsumo

NO_CHECKS, BRAKES_HARD = 0, 27
"""Speed modes: any speed; all checks except for comfortable deceleration."""

_HEEDS_LEADERS = 1 + 32  # speed mode: a safe gap, no right of way
_CHANGES_LANES, _KEEPS_LANE = 1621, 0  # lane change modes: SUMO's default; only when told, regardless of others
_LATERAL_MPS, _LATERAL_MPS2 = 1.8, "3"


class GivenMotion:
    """Speeds, moves to the side and blinkers that are given to vehicles.

    Attributes:
        moved: Names of the vehicles whose speed is given.
        blinkers: Bits of the blinkers that are on, by row; other vehicles use theirs as SUMO does.
    """

    def __init__(self, names: Sequence[str], left_sign: float) -> None:
        """For vehicles with these names; ``left_sign`` is that of lateral positions to the left."""
        self.moved: set[str] = set()
        self.blinkers: dict[int, int] = {}
        self._names, self._left_sign = names, left_sign
        self._left: set[str] = set()

    def leave(self, name: str) -> None:
        """Give a vehicle, which has crashed, no motion any more."""
        self.moved.discard(name)
        self._left.add(name)

    def set_speed(self, vehicle: int, speed_mps: float | None, heeds_leaders: bool = False) -> None:
        """Give a vehicle its speed at the next step; None: its driver drives again.

        It keeps its lane, yields to nobody in junctions, and brakes for those ahead on its lane only if it
        ``heeds_leaders``.
        """
        name, is_given = self._names[vehicle], speed_mps is not None
        if name in self._left:
            return
        (self.moved.add if is_given else self.moved.discard)(name)
        given_mode = _HEEDS_LEADERS if heeds_leaders else NO_CHECKS
        libsumo.vehicle.setSpeedMode(name, given_mode if is_given else BRAKES_HARD)
        libsumo.vehicle.setLaneChangeMode(name, _KEEPS_LANE if is_given else _CHANGES_LANES)
        libsumo.vehicle.setSpeed(name, -1.0 if speed_mps is None else speed_mps)

    def move_aside(self, vehicle: int, left_m: float) -> None:
        """Let a vehicle whose speed is given move to the left, on other lanes too, regardless of others."""
        if (name := self._names[vehicle]) not in self._left:
            libsumo.vehicle.setMaxSpeedLat(name, _LATERAL_MPS)
            libsumo.vehicle.setParameter(name, "laneChangeModel.lcAccelLat", _LATERAL_MPS2)
            libsumo.vehicle.changeSublane(name, self._left_sign * left_m)
