"""The simulation of a scene: SceneSpec and roads in, one WorldState per tick out.

SUMO decides where everybody goes. The tables that leave here are smooth and rigid, and a fixed part of a second behind
SUMO; all in them, lights and signals too, is of the same moment.
"""

import tempfile
from pathlib import Path
from types import TracebackType
from typing import Self

from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import EGO_ID, WorldState
from simbev_ros.world.actors import Actors
from simbev_ros.world.curves import bend_speeds
from simbev_ros.world.demand import demand_of
from simbev_ros.world.net_crop import cropped_net
from simbev_ros.world.signals import SignalHeads, programmes, programmes_xml
from simbev_ros.world.tracks import Tracks
from simbev_ros.world.traffic import Traffic

_ON_FOOT = (LaneKind.CROSSING, LaneKind.WALKING_AREA)
_NO_TRAFFIC = (LaneKind.PARKING, LaneKind.SHOULDER, LaneKind.MEDIAN)


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
        net = network.net_path.read_text(encoding="utf-8")
        cycles = programmes(spec, net)
        self._signal_heads = SignalHeads(network.signals, cycles, spec.tick_ns)
        demand = demand_of(spec, network)
        part = cropped_net(net, demand.edges)
        lanes = [each for each in network.lanes.values() if each.edge in part.edges and each.kind not in _ON_FOOT]
        signals = programmes_xml([cycle for cycle in cycles if cycle.id in part.lights], spec.tick_ns)
        with tempfile.TemporaryDirectory(prefix="simbev-") as folder:
            inputs = {"scene.net.xml": part.xml, "scene.rou.xml": demand.xml, "scene.add.xml": signals}
            for name, text in inputs.items():
                Path(folder, name).write_text(text, encoding="utf-8")
            files = [Path(folder, name) for name in inputs]
            closed = [lane.id for lane in lanes if lane.kind in _NO_TRAFFIC and lane.classes]
            self._traffic = Traffic(files, spec.tick_ns, spec.seed, bend_speeds(lanes), Tracks(lanes), closed)
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
