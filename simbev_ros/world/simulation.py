"""The simulation of a scene: SceneSpec and roads in, one WorldState per tick out.

SUMO decides where everybody goes. The tables that leave here are smooth and rigid, and a fixed part of a second behind SUMO; all
in them, lights and signals too, is of the same moment.
"""

import logging
import tempfile
from collections import deque
from pathlib import Path
from types import TracebackType
from typing import Self
from xml.etree import ElementTree

import numpy as np
import shapely

from simbev_ros.assets.ground import CURB_HEIGHT_M
from simbev_ros.errors import SimulationError
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.surface import sidewalk_surface
from simbev_ros.scene.spec import NS_PER_S, SceneSpec
from simbev_ros.scene.state import EGO_ID, WorldState
from simbev_ros.types import Float64Array
from simbev_ros.world.cast import cast_of
from simbev_ros.world.curves import bend_speeds
from simbev_ros.world.demand import demand_xml, index_of
from simbev_ros.world.motion import Motion, Pursuit
from simbev_ros.world.signals import SignalHeads, programmes, programmes_xml
from simbev_ros.world.table import ActorTable
from simbev_ros.world.traffic import Traffic, TrafficSample

_LOGGER = logging.getLogger(__name__)
_HALF_WINDOW_S = 0.35
_HURRY = 1.3  # a pedestrian's highest speed while it makes up for a sideways jump of SUMO's, over its highest speed there


class Simulation:
    """One scene, from the start of its warm-up. Use it as a context manager: a process can run one at a time."""

    def __init__(self, spec: SceneSpec, network: RoadNetwork) -> None:
        """Put everybody in place, at rest.

        Args:
            spec: The scene.
            network: The roads of ``spec.map``.

        Raises:
            SimulationError: SUMO failed, the ego found no place, or a simulation is running in this process already.
        """
        self._spec = spec
        self._sidewalk = sidewalk_surface(network)
        shapely.prepare(self._sidewalk)
        net = ElementTree.parse(network.net_path).getroot()
        cycles = programmes(spec, net)
        self._signal_heads = SignalHeads(network.signals, cycles, spec.tick_ns)
        with tempfile.TemporaryDirectory(prefix="simbev-") as folder:
            demand, additional = Path(folder, "demand.rou.xml"), Path(folder, "signals.add.xml")
            demand.write_text(demand_xml(spec, network, net), encoding="utf-8")
            additional.write_text(programmes_xml(cycles, spec.tick_ns), encoding="utf-8")
            self._traffic = Traffic(
                network.net_path, demand, additional, spec.tick_ns, spec.seed, bend_speeds(network)
            )
        try:
            self._start()
        except BaseException:
            self.close()
            raise

    def step(self) -> WorldState:
        """The state one tick on: tick -spec.warm_up_ticks, all at rest, at the first call; tick 0 after the warm-up's.

        Raises:
            SimulationError: SUMO failed.
        """
        if self._steps:
            self._traffic.step()
            sample = self._traffic.sample()
            self._points_m = self._leading_points(sample)
            self._signals.append(sample.signals)
        kinematics = self._motion.advance(self._points_m)
        tick = self._steps - self._spec.warm_up_ticks
        state = WorldState(
            stamp_ns=self._spec.stamp_ns(tick),
            tick=tick,
            ego_id=EGO_ID,
            actors=self._table.at(kinematics, self._signals[0], self._steps),
            signals=self._signal_heads.at(self._steps - self._motion.delay_ticks),
            weather=self._spec.weather,
        )
        self._steps += 1
        return state

    def close(self) -> None:
        """End SUMO; a second call does nothing."""
        self._traffic.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _start(self) -> None:
        """All that is kept from tick to tick, at SUMO's time 0."""
        spec, tick_s = self._spec, self._spec.tick_ns / NS_PER_S
        vehicles, pedestrians = self._present()
        sample = self._traffic.sample()
        fastest_mps = np.array([spec.pedestrians[index].max_speed_mps for index in pedestrians])
        self._pursuit = Pursuit(sample.pedestrian_m, _HURRY * fastest_mps * tick_s)
        self._points_m = self._leading_points(sample)
        cast = cast_of(spec, vehicles, pedestrians)
        half_window_ticks = max(1, round(_HALF_WINDOW_S / tick_s))
        self._motion = Motion(cast.bodies, self._points_m, self._traffic.directions(), tick_s, half_window_ticks)
        # The oldest entry is of the tick that the kinematics are of.
        delay_ticks = self._motion.delay_ticks
        self._signals = deque([sample.signals] * (delay_ticks + 1), maxlen=delay_ticks + 1)
        self._table = ActorTable(spec, cast, len(vehicles))
        self._steps = 0

    def _present(self) -> tuple[list[int], list[int]]:
        """Which vehicles and pedestrians of the specification SUMO has placed."""
        vehicles = [index_of(name) for name in self._traffic.vehicles]
        pedestrians = [index_of(name) for name in self._traffic.pedestrians]
        for kind, present, wanted in (
            ("vehicle", vehicles, self._spec.vehicles),
            ("pedestrian", pedestrians, self._spec.pedestrians),
        ):
            for index in sorted(set(range(len(wanted))) - set(present)):
                start = wanted[index].start
                place = f"lane {start.lane} at {start.s_m:.1f} m"
                if kind == "vehicle" and index == 0:
                    raise SimulationError(f"{self._spec.name}: the ego finds no place on {place}; something stands there")
                _LOGGER.warning("%s: %s %d is left out; no place on %s", self._spec.name, kind, index, place)
        return vehicles, pedestrians

    def _leading_points(self, sample: TrafficSample) -> Float64Array:
        """(G, 3) points that the bodies follow: vehicles' front bumpers, then pedestrians on the curb or the road."""
        pedestrian_m = self._pursuit.advance(sample.pedestrian_m)
        raised = shapely.contains_xy(self._sidewalk, pedestrian_m[:, :2])
        lift_m = np.stack([np.zeros(len(raised)), np.zeros(len(raised)), CURB_HEIGHT_M * raised], axis=1)
        return np.concatenate([sample.front_m, pedestrian_m + lift_m])
