"""The simulation of a scene: SceneSpec and roads in, one WorldState per tick out.

SUMO decides where everybody goes. The tables that leave here are smooth and rigid, and a fixed part of a second behind
SUMO; all in them, lights and signals too, is of the same moment.
"""

import gc
import tempfile
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from simbev_ros.assets.land.plazas import Plaza
from simbev_ros.assets.street.obstacles import OBSTACLE_DTYPE
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.scene.ending import DURATION
from simbev_ros.scene.spec import NS_PER_S, SceneSpec
from simbev_ros.scene.state import EGO_ID, WorldState
from simbev_ros.types import Table
from simbev_ros.world.actors import Actors
from simbev_ros.world.cast import blueprint_of
from simbev_ros.world.demand import demand_of
from simbev_ros.world.driving.ego_driver import EgoDriver
from simbev_ros.world.driving.rain import rain_effect
from simbev_ros.world.population import Population
from simbev_ros.world.sumo.closures import with_closures
from simbev_ros.world.sumo.curve_speeds import bend_speeds
from simbev_ros.world.sumo.net_crop import cropped_net
from simbev_ros.world.sumo.routes import Routes
from simbev_ros.world.sumo.signals import SignalHeads, programmes, programmes_xml
from simbev_ros.world.sumo.tracks import Tracks

_ON_FOOT = (LaneKind.CROSSING, LaneKind.WALKING_AREA)
_NO_OBSTACLES = np.empty(0, OBSTACLE_DTYPE)
_NO_TRAFFIC = (LaneKind.PARKING, LaneKind.SHOULDER, LaneKind.MEDIAN)


class Simulation:
    """One scene, from the start of its warm-up. Use it as a context manager: a process can run one at a time."""

    def __init__(
        self,
        spec: SceneSpec,
        network: RoadNetwork,
        obstacles: Table = _NO_OBSTACLES,
        plazas: Sequence[Plaza] = (),
    ) -> None:
        """Put everybody in place, at rest.

        Args:
            spec: The scene.
            network: The roads of ``spec.map``.
            obstacles: (K,) ``OBSTACLE_DTYPE``, what people walk around.
            plazas: What people visit.

        Raises:
            SimulationError: SUMO failed, the ego found no place, or a simulation is running in this process already.
        """
        self._spec = spec
        self._steps = 0
        self._second_ticks = max(1, round(NS_PER_S / spec.tick_ns))
        net = network.net_path.read_text(encoding="utf-8")
        cycles = programmes(spec, net)
        self._signal_heads = SignalHeads(network.signals, cycles, spec.tick_ns)
        demand = demand_of(spec, network, plazas)
        part = cropped_net(net, demand.edges)
        self._routes = Routes(spec, network, part.edges)
        lanes = [each for each in network.lanes.values() if each.edge in part.edges and each.kind not in _ON_FOOT]
        signals = programmes_xml([cycle for cycle in cycles if cycle.id in part.lights], spec.tick_ns)
        with tempfile.TemporaryDirectory(prefix="simbev-") as folder:
            inputs = {"scene.net.xml": part.xml, "scene.rou.xml": demand.xml, "scene.add.xml": signals}
            for name, text in inputs.items():
                Path(folder, name).write_text(text, encoding="utf-8")
            files = [Path(folder, name) for name in inputs]
            closed = [lane.id for lane in lanes if lane.kind in _NO_TRAFFIC and lane.classes]
            speeds_mps = with_closures(bend_speeds(lanes), spec, lanes)
            self._traffic = Population(spec, files, speeds_mps, Tracks(lanes), closed)
        try:
            self._actors = Actors(spec, network, self._traffic, obstacles, demand.excursions)
            self._driver = self._ego_driver(network) if spec.ego_driver == "twist" else None
        except BaseException:
            self.close()
            raise
        gc.freeze()  # all that is loaded stays, and looking through it for garbage takes a tick's time twice over

    @property
    def available(self) -> tuple[int, str]:
        """All ticks of the scene; it ends with its duration."""
        return self._spec.ticks, DURATION

    def _ego_driver(self, network: RoadNetwork) -> EgoDriver:
        """For an ego that is driven from outside; it goes no faster than the fastest road allows, times its factor."""
        ego = self._spec.vehicles[0]
        blueprint = blueprint_of(ego.blueprint)
        fastest_mps = max(lane.speed_mps for lane in network.lanes.values()) * max(ego.speed_factor, 1.0)
        return EgoDriver(
            blueprint,
            self._traffic.sample().front_m[0],
            self._traffic.direction(0),
            min(blueprint.max_speed_mps, fastest_mps),
            self._spec.tick_ns / NS_PER_S,
            self._actors.ground.heights_m,
        )

    def drive_ego(self, speed_mps: float, yaw_rate_radps: float) -> None:
        """How an ego that is driven from outside shall move from the next tick on; it brakes after 0.5 s without."""
        if self._driver is not None:
            self._driver.command(speed_mps, yaw_rate_radps)

    def step(self) -> WorldState:
        """The state one tick on: tick -spec.warm_up_ticks, all at rest, at the first call; tick 0 after the warm-up's.

        Raises:
            SimulationError: SUMO failed.
        """
        if self._steps:
            if self._driver is not None:
                self._driver.advance()
                self._traffic.drive(0, self._driver.front_m, self._driver.yaw_rad)
            self._traffic.step()
        tick = self._steps - self._spec.warm_up_ticks
        if self._steps % self._second_ticks == 0:
            self._prolong_routes()
            self._traffic.make_room()
            if self._spec.final_weather is not None:
                self._adapt_to_rain(tick)
        actors = self._actors.advance(self._traffic.sample(), self._steps)
        state = WorldState(
            stamp_ns=self._spec.stamp_ns(tick),
            tick=tick,
            ego_id=EGO_ID,
            actors=actors,
            signals=self._signal_heads.at(self._steps - self._actors.delay_ticks),
            weather=self._spec.weather_at(tick),
            events=self._actors.events,
        )
        self._steps += 1
        return state

    def _prolong_routes(self) -> None:
        """Give new routes to those whose routes end soon, except for an ego that is driven from outside."""
        for row, edge in self._traffic.ending():
            if row == 0 and self._driver is not None:
                continue
            onward = self._routes.onward(self._traffic.vehicles[row], edge, self._steps)
            self._traffic.prolong(row, onward.edges, onward.last_lane)

    def _adapt_to_rain(self, tick: int) -> None:
        effect = rain_effect(self._spec.weather_at(tick))
        for row, index in enumerate(self._traffic.vehicles[: self._traffic.moving]):
            vehicle = self._spec.vehicles[index]
            self._traffic.adapt(row, vehicle.speed_factor * effect.speed, vehicle.headway_s * effect.headway)

    def close(self) -> None:
        """End SUMO; a second call does nothing."""
        gc.unfreeze()
        self._traffic.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()
