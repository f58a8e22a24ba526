"""SUMO's pedestrians: where they are, and walks that are given to them. They are given by their rows."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from simbev_ros.foundation.errors import SimulationError
from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.world.sumo.libsumo_import import FAILURES, libsumo
from simbev_ros.simulation.world.sumo.names import index_of, pedestrian_name

_FOREVER_S = 1e8
_ANY_ARRIVAL_M = 1.0
_AXES = 3


class SumoPedestrians:
    """The pedestrians of the running simulation.

    Attributes:
        indices: Indices in the specification of those that SUMO could insert, ascending.
    """

    def __init__(self) -> None:
        self.indices = tuple(sorted(map(index_of, libsumo.person.getIDList())))
        self._names = [pedestrian_name(index) for index in self.indices]
        self._off_net: dict[str, dict[int, Any]] = {}
        self._latest_points: dict[int, tuple[float, float, float]] = {}
        for name in self._names:
            libsumo.person.subscribe(name, [libsumo.VAR_POSITION3D])

    def angles_deg(self) -> list[float]:
        """P headings, clockwise from north."""
        return [libsumo.person.getAngle(name) for name in self._names]

    def points_m(self) -> Float64Array:
        """(P, 3) positions; where SUMO has none, as on walking areas without extent, the latest one.

        Raises:
            KeyError: One has left the simulation.
        """
        results = {**libsumo.person.getAllSubscriptionResults(), **self._off_net}
        for row, name in enumerate(self._names):
            point = results[name][libsumo.VAR_POSITION3D]
            if len(point) == _AXES:  # an invalid position has two coordinates
                self._latest_points[row] = point
        points = [self._latest_points[row] for row in range(len(self._names))]
        return np.array(points, np.float64).reshape(-1, 3)

    def hold(self, row: int) -> None:
        """Let one stand where it is."""
        if self._names[row] not in self._off_net:
            self.limit_speed(row, 0.0)

    def remove(self, row: int) -> None:
        """Take one off the network; it keeps its last position."""
        if (name := self._names[row]) not in self._off_net:
            self._off_net[name] = dict(libsumo.person.getSubscriptionResults(name))
            libsumo.person.remove(name)

    def reinsert(self, row: int, edges: Sequence[str], position_m: float, arrival_m: float | None, passes: int) -> None:
        """Let one that was removed walk along edges, from the next step on.

        Args:
            row: The pedestrian.
            edges: All edges of the walk.
            position_m: SUMO's position on the first edge where the walk starts.
            arrival_m: SUMO's position on the last edge where it ends; None: anywhere.
            passes: Number of times that the last edge is walked up and down after that.

        Raises:
            SimulationError: SUMO failed.
        """
        before, kind = self._names[row], pedestrian_name(self.indices[row])
        del self._off_net[before]
        name = f"{kind}.{int(before.partition('.')[2] or 0) + 1}"
        try:
            libsumo.person.add(name, edges[0], position_m, typeID=kind)
            length_m = libsumo.lane.getLength(f"{edges[-1]}_0")  # of all lanes of the edge; maybe a few centimeters
            arrival_m = min(_ANY_ARRIVAL_M if arrival_m is None else arrival_m, length_m)
            libsumo.person.appendWalkingStage(name, list(edges), arrival_m)
            for number in range(passes):
                libsumo.person.appendWalkingStage(name, [edges[-1]], 0.0 if number % 2 else length_m)
            libsumo.person.appendWaitingStage(name, _FOREVER_S)
            libsumo.person.subscribe(name, [libsumo.VAR_POSITION3D])
        except FAILURES as error:
            raise SimulationError(f"SUMO failed: {error}") from error
        self._names[row] = name

    def limit_speed(self, row: int, speed_mps: float) -> None:
        """Limit the speed of one."""
        libsumo.person.setSpeed(self._names[row], speed_mps)

    def is_on_sidewalk(self, row: int) -> bool:
        """Whether one is on the sidewalk of a street, not in a junction or on a crosswalk."""
        return not libsumo.person.getRoadID(self._names[row]).startswith(":")
