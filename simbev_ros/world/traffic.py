"""SUMO, in this process: one simulation, advanced tick by tick and read as arrays. Nothing else here knows libsumo."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import libsumo
import numpy as np

from simbev_ros.errors import SimulationError
from simbev_ros.types import Float64Array, Int64Array
from simbev_ros.world.demand import index_of

_OPTIONS = {
    "lateral-resolution": "0.8",
    "pedestrian.model": "striping",
    "pedestrian.striping.dawdling": "0",
    "pedestrian.striping.walkingarea-detail": "20",
    "time-to-teleport": "-1",
    "collision.action": "none",
    "intermodal-collision.action": "none",
    "max-depart-delay": "0",
    "threads": "1",
    "xml-validation": "never",
    "no-step-log": "true",
    "no-warnings": "true",
    "duration-log.disable": "true",
}
_LARGEST_SEED = 2**31 - 1


@dataclass(frozen=True, slots=True)
class TrafficSample:
    """What SUMO says at one tick, in the order of ``Traffic.vehicles`` and ``Traffic.pedestrians``; map frame.

    Attributes:
        front_m: (V, 3) middle of each vehicle's front bumper, on the road.
        signals: (V,) int64, SUMO's vehicle signals (bit 0 right blinker, bit 1 left blinker).
        pedestrian_m: (P, 3) each pedestrian, on the surface of its lane.
    """

    front_m: Float64Array
    signals: Int64Array
    pedestrian_m: Float64Array


class Traffic:
    """A running SUMO simulation. libsumo holds one per process; close this one before another is made.

    Attributes:
        vehicles: SUMO's ids of the vehicles that found a place, by their index.
        pedestrians: The same of the pedestrians.
    """

    _running = False

    def __init__(
        self, net: Path, demand: Path, additional: Path, tick_ns: int, seed: int, speeds_mps: Mapping[str, float]
    ) -> None:
        """Load a net and its traffic, and place all vehicles and pedestrians at time 0.

        Args:
            net: SUMO net file.
            demand: Route file; everything in it departs at 0.
            additional: Additional file, with the traffic lights' programmes.
            tick_ns: Length of a step; whole milliseconds.
            seed: Of SUMO's own random numbers.
            speeds_mps: Lane id → speed limit that takes the place of the net's.

        Raises:
            SimulationError: another simulation is running in this process, or SUMO does not accept its input.
        """
        if Traffic._running:
            raise SimulationError("a simulation is running in this process already; close it first")
        if tick_ns % 1_000_000:
            raise SimulationError(f"SUMO needs ticks of whole milliseconds, not {tick_ns} ns")
        options = {
            **_OPTIONS,
            "net-file": str(net),
            "route-files": str(demand),
            "additional-files": str(additional),
            "step-length": f"{tick_ns / 1e9:.3f}",
            "seed": str(seed % _LARGEST_SEED),
        }
        arguments = [argument for name, value in options.items() for argument in (f"--{name}", value)]
        self._open = Traffic._running = True
        try:
            libsumo.start(["sumo", *arguments])
            for lane, speed_mps in speeds_mps.items():
                libsumo.lane.setMaxSpeed(lane, speed_mps)
            libsumo.simulationStep()
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            self.close()
            raise SimulationError(f"SUMO could not start: {error}") from error
        self.vehicles: tuple[str, ...] = tuple(sorted(libsumo.vehicle.getIDList(), key=index_of))
        self.pedestrians: tuple[str, ...] = tuple(sorted(libsumo.person.getIDList(), key=index_of))
        for name in self.vehicles:
            libsumo.vehicle.subscribe(name, [libsumo.VAR_POSITION3D, libsumo.VAR_SIGNALS])
        for name in self.pedestrians:
            libsumo.person.subscribe(name, [libsumo.VAR_POSITION3D])

    def directions(self) -> Float64Array:
        """(V + P, 3) unit vectors in which vehicles, then pedestrians, look now; map frame."""
        angles_deg = [
            *[(libsumo.vehicle.getAngle(name), libsumo.vehicle.getSlope(name)) for name in self.vehicles],
            *[(libsumo.person.getAngle(name), 0.0) for name in self.pedestrians],
        ]
        return _directions(angles_deg)

    def sample(self) -> TrafficSample:
        """The state now.

        Raises:
            SimulationError: somebody has left the simulation.
        """
        vehicles = libsumo.vehicle.getAllSubscriptionResults()
        pedestrians = libsumo.person.getAllSubscriptionResults()
        try:
            return TrafficSample(
                _points([vehicles[name][libsumo.VAR_POSITION3D] for name in self.vehicles]),
                np.array([vehicles[name][libsumo.VAR_SIGNALS] for name in self.vehicles], np.int64),
                _points([pedestrians[name][libsumo.VAR_POSITION3D] for name in self.pedestrians]),
            )
        except KeyError as error:
            raise SimulationError(f"SUMO has lost {error} at {libsumo.simulation.getTime():.3f} s") from error

    def step(self) -> None:
        """Advance by one tick.

        Raises:
            SimulationError: SUMO failed.
        """
        try:
            libsumo.simulationStep()
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            raise SimulationError(f"SUMO failed: {error}") from error

    def close(self) -> None:
        """End the simulation; a second call does nothing."""
        if self._open:
            libsumo.close()
            self._open = Traffic._running = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


def _points(points: Sequence[tuple[float, float, float]]) -> Float64Array:
    return np.array(points, np.float64).reshape(-1, 3)


def _directions(angles_deg: Sequence[tuple[float, float]]) -> Float64Array:
    """(N, 3) unit vectors of SUMO's angle (clockwise from north) and slope, both in degrees."""
    angle, slope = np.radians(np.array(angles_deg, np.float64).reshape(-1, 2)).T
    return np.stack([np.sin(angle) * np.cos(slope), np.cos(angle) * np.cos(slope), np.sin(slope)], axis=1)
