"""The simulation of a scene: SceneSpec and roads in, one WorldState per tick out.

SUMO decides where everybody goes. The tables that leave here are smooth and rigid, and a fixed part of a second behind
SUMO; all in them, lights and signals too, is of the same moment.
"""

import tempfile
from pathlib import Path
from types import TracebackType
from typing import Self
from xml.etree import ElementTree

from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import EGO_ID, WorldState
from simbev_ros.world.actors import Actors
from simbev_ros.world.curves import bend_speeds
from simbev_ros.world.demand import demand_xml
from simbev_ros.world.signals import SignalHeads, programmes, programmes_xml
from simbev_ros.world.traffic import Traffic


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
        self._steps = 0
        net = ElementTree.parse(network.net_path).getroot()
        cycles = programmes(spec, net)
        self._signal_heads = SignalHeads(network.signals, cycles, spec.tick_ns)
        with tempfile.TemporaryDirectory(prefix="simbev-") as folder:
            demand, additional = Path(folder, "demand.rou.xml"), Path(folder, "signals.add.xml")
            demand.write_text(demand_xml(spec, network, net), encoding="utf-8")
            additional.write_text(programmes_xml(cycles, spec.tick_ns), encoding="utf-8")
            self._traffic = Traffic(
                [network.net_path, demand, additional], spec.tick_ns, spec.seed, bend_speeds(network)
            )
        try:
            self._actors = Actors(spec, network, self._traffic)
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
        tick = self._steps - self._spec.warm_up_ticks
        state = WorldState(
            stamp_ns=self._spec.stamp_ns(tick),
            tick=tick,
            ego_id=EGO_ID,
            actors=self._actors.advance(self._traffic.sample(), self._steps),
            signals=self._signal_heads.at(self._steps - self._actors.delay_ticks),
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
