"""Impatience of SUMO's drivers who wait before junctions."""

from collections.abc import Sequence

from simbev_ros.simulation.world.sumo.libsumo_import import libsumo
from simbev_ros.simulation.world.sumo.names import vehicle_name

_PATIENCE_S = 20.0  # as ``time-to-impatience``
_DRIVING_MPS = 3.0


class Impatience:
    """Lets drivers who have waited long drive off where others then have to brake for them.

    SUMO's own impatience ends when a vehicle is faster than 0.1 m/s. With short ticks, this is the first tick in which
    it moves; then its driver yields again, and the vehicle never enters the junction.
    """

    def __init__(self, vehicles: Sequence[int]) -> None:
        """Start when all vehicles, given by their indices in the specification, stand."""
        names = map(vehicle_name, vehicles)
        self._waited_s = {name: 0.0 for name in names if not libsumo.vehicletype.getImpatience(_type_of(name))}

    def update(self, period_s: float) -> None:
        """Let impatience grow with the time since a vehicle has last driven; ``period_s`` is that between two calls."""
        present = {*libsumo.vehicle.getIDList()}
        for name, before_s in self._waited_s.items():
            if name in present:
                drives = libsumo.vehicle.getSpeed(name) > _DRIVING_MPS
                self._waited_s[name] = waited_s = 0.0 if drives else min(before_s + period_s, _PATIENCE_S)
                if waited_s != before_s:
                    libsumo.vehicletype.setImpatience(_type_of(name), waited_s / _PATIENCE_S)


def _type_of(name: str) -> str:
    type_id: str = libsumo.vehicle.getTypeID(name)
    return type_id
