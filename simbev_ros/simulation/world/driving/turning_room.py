"""Drivers leave room for those who turn round at the end of a road: one turns, the others wait some meters behind.

SUMO lets vehicles queue right up to the end. A vehicle that turns round there swings into the first one of the queue,
and then both would wait for each other for good.
"""

from collections.abc import Mapping

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.world.sumo.traffic import SumoTraffic

_REASON = "turning room"
_ROOM_M = 7.0  # from the waiting vehicle's front to the end of its road: a car's length and its swing
_CLEAR_M = 2.0  # from the start of the road back to the rear of the vehicle that has turned
_TOLERANCE_M = 0.5
_BRAKING_MPS2 = 2.0


class TurningRoom:
    """Keeps drivers back who would turn round where another vehicle does so."""

    def __init__(
        self,
        turns: Mapping[str, str],
        edge_length_m: Mapping[str, float],
        vehicle_length_m: Float64Array,
        traffic: SumoTraffic,
    ) -> None:
        """Observe the ends of some roads.

        Args:
            turns: Edge that leads to the end of a road → edge that leads back.
            edge_length_m: SUMO's lengths of these edges.
            vehicle_length_m: (V,) lengths.
            traffic: SUMO.
        """
        self._turns, self._edge_length_m = turns, edge_length_m
        self._end_of = {back: there for there, back in turns.items()}
        self._vehicle_length_m = vehicle_length_m
        self._traffic = traffic
        self._held: set[int] = set()

    def hold_back(self) -> None:
        """Limit the speeds of the drivers who have to wait; call it before each step of the traffic."""
        if not self._turns:
            return
        waiting, occupied = self._approaches()
        held: dict[int, float] = {}
        for there, queue in waiting.items():
            queue.sort()
            held.update({vehicle: left_m for left_m, vehicle in queue[0 if there in occupied else 1 :]})
        for vehicle in sorted(self._held - held.keys()):
            self._traffic.limit_speed(vehicle, _REASON, None)
        for vehicle, left_m in held.items():
            speed_mps = float(np.sqrt(2.0 * _BRAKING_MPS2 * max(left_m - _ROOM_M, 0.0)))
            self._traffic.limit_speed(vehicle, _REASON, speed_mps)
        self._held = set(held)

    def _approaches(self) -> tuple[dict[str, list[tuple[float, int]]], set[str]]:
        """By edge, the distances to its end and the vehicles that come to turn there; and the edges where one turns."""
        progress = self._traffic.progress
        waiting: dict[str, list[tuple[float, int]]] = {}
        occupied: set[str] = set()
        for vehicle, (lane, position_m, following) in enumerate(zip(*progress, strict=True)):
            edge = lane.rsplit("_", 1)[0]
            if lane.startswith(":"):
                occupied |= {self._end_of[following]} if following in self._end_of else set()
            elif following and self._turns.get(edge) == following:
                left_m = self._edge_length_m[edge] - position_m
                if left_m < _ROOM_M - _TOLERANCE_M:
                    occupied.add(edge)
                else:
                    waiting.setdefault(edge, []).append((left_m, vehicle))
            if edge in self._end_of and position_m - self._vehicle_length_m[vehicle] < _CLEAR_M:
                occupied.add(self._end_of[edge])
        return waiting, occupied
