"""Simulation of a scene: ``SceneSpec``, roads and what is beside them in, one ``WorldState`` per tick out.

SUMO decides where vehicles and pedestrians move. The published tables are smooth, rigid-body motion, a fixed fraction
of a second behind SUMO. Everything in a table, including lights and signals, belongs to the same moment.
"""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np

from simbev_ros.assets.land.plazas import Plaza
from simbev_ros.assets.street.obstacles import OBSTACLE_DTYPE
from simbev_ros.assets.street.parking_spots import SPOT_DTYPE
from simbev_ros.assets.street.rest_kinds import REST_DTYPE
from simbev_ros.foundation.files.whole_files import write_errors
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.ending import DURATION
from simbev_ros.scene.streets.streets import streets_of
from simbev_ros.scene.weather_course import WeatherCourse
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID, SignalState, WorldState
from simbev_ros.simulation.world.actors import Actors
from simbev_ros.simulation.world.demand import demand_of
from simbev_ros.simulation.world.driving.commands import DriverCommand
from simbev_ros.simulation.world.driving.making_way import MakingWay
from simbev_ros.simulation.world.driving.outside_drivers import OutsideDrivers
from simbev_ros.simulation.world.driving.rain import rain_effect
from simbev_ros.simulation.world.driving.speed_bumps import SpeedBumps
from simbev_ros.simulation.world.driving.turning_room import TurningRoom
from simbev_ros.simulation.world.entities import Entities
from simbev_ros.simulation.world.events.route_events import RouteEvents
from simbev_ros.simulation.world.population import Population
from simbev_ros.simulation.world.sumo.closures import slow_near_closures
from simbev_ros.simulation.world.sumo.curve_speeds import curve_speeds
from simbev_ros.simulation.world.sumo.impatience import Impatience
from simbev_ros.simulation.world.sumo.net_crop import crop_net
from simbev_ros.simulation.world.sumo.routes import Routes
from simbev_ros.simulation.world.sumo.signals import SignalHeads, signal_programs, signal_programs_xml
from simbev_ros.simulation.world.sumo.start import sumo_step_ns
from simbev_ros.simulation.world.sumo.tracks import LaneTracks
from simbev_ros.simulation.world.sumo.traffic import SumoTraffic

if TYPE_CHECKING:
    from simbev_ros.simulation.world.storyboard.player import StoryboardPlayer

_ON_FOOT = (LaneKind.CROSSING, LaneKind.WALKING_AREA)
_NO_OBSTACLES = np.empty(0, OBSTACLE_DTYPE)
_NO_SPOTS = np.empty(0, SPOT_DTYPE)
_NO_RESTS = np.empty(0, REST_DTYPE)
_CLEARANCE_M = 3.0  # between the surface of a road and an entity above or below it that is not heeded
_NO_TRAFFIC = (LaneKind.PARKING, LaneKind.SHOULDER, LaneKind.MEDIAN)


class Simulation:
    """One running scene, from the start of its warm-up. Use it as a context manager; only one can run per process.

    Attributes:
        weather: Weather at each tick, which commands may change.
        entities: Actors that commands have put into the scene or moved.
        route_events: The events along the route of the first agent.
    """

    def __init__(
        self,
        spec: SceneSpec,
        network: RoadNetwork,
        obstacles: Table = _NO_OBSTACLES,
        plazas: Sequence[Plaza] = (),
        parking_spots: Table = _NO_SPOTS,
        rests: Table = _NO_RESTS,
    ) -> None:
        """Place all actors, at rest.

        Args:
            spec: The scene.
            network: The roads of ``spec.map``.
            obstacles: (K,) ``OBSTACLE_DTYPE``, which pedestrians walk around.
            plazas: Plazas that pedestrians visit.
            parking_spots: (S,) ``SPOT_DTYPE``, some of which parked vehicles take.
            rests: (R,) ``REST_DTYPE``, some of which people take.

        Raises:
            SimulationError: SUMO failed, an agent's vehicle has no room, or this process runs another simulation.
        """
        self._spec, self._steps, self.weather = spec, 0, WeatherCourse(spec)
        self._ticks_per_second = max(1, round(NS_PER_S / spec.tick_ns))
        net = network.net_path.read_text(encoding="utf-8")
        cycles = signal_programs(spec, net)
        self._signal_heads = SignalHeads(network.signals, cycles, spec.tick_ns)
        demand, step_ns = demand_of(spec, network, plazas), sumo_step_ns(spec.tick_ns)
        cropped = crop_net(net, demand.edges)
        self._routes = Routes(spec, network, cropped.edges)
        lanes = [each for each in network.lanes.values() if each.edge in cropped.edges and each.kind not in _ON_FOOT]
        signals = signal_programs_xml([cycle for cycle in cycles if cycle.id in cropped.lights], step_ns)
        with tempfile.TemporaryDirectory(prefix="simbev-") as folder:
            files = _written(Path(folder), {"net": cropped.xml, "rou": demand.xml, "add": signals})
            closed = [lane.id for lane in lanes if lane.kind in _NO_TRAFFIC and lane.classes]
            speeds_mps = slow_near_closures(curve_speeds(lanes), spec, lanes)
            tracks = LaneTracks(lanes)
            self._sumo = SumoTraffic(files, step_ns, spec.seed, speeds_mps, tracks, closed, cropped.left_hand)
        try:
            self._population = Population(spec, self._sumo)
            self._actors = Actors(
                spec, network, self._population, obstacles, demand.excursions, self.weather, parking_spots, rests
            )
            heights_m = None if self._actors.ground.is_level else self._actors.ground.heights_m
            self.entities = Entities(spec.tick_ns / NS_PER_S, self._actors.free_id, heights_m)
            self._storyboard = self._storyboard_player(network, heights_m)
            self._add_rules(network, step_ns / NS_PER_S)
            delay_ticks = self._actors.commanded_delay_ticks
            self._outside_drivers = OutsideDrivers(
                spec, network, self._sumo, self._actors.ground.heights_m, delay_ticks
            )
            self.route_events = RouteEvents(
                spec, self._population, self._actors, self.weather, lambda: self._steps - spec.warm_up_ticks + 1
            )
        except BaseException:
            self.close()
            raise

    @property
    def available(self) -> tuple[int, str]:
        """Number of ticks of the scene, and "duration" as the reason for its end."""
        return self._spec.ticks, DURATION

    def _storyboard_player(
        self, network: RoadNetwork, heights_m: Callable[[Float64Array], Float64Array] | None
    ) -> "StoryboardPlayer | None":
        """The player of the scene's scenario; None: it has none."""
        if self._spec.storyboard is None:
            return None
        from simbev_ros.simulation.world.storyboard.player import StoryboardPlayer  # what few scenes need

        return StoryboardPlayer(self._spec, network, self.entities, self.weather, heights_m)

    def _add_rules(self, network: RoadNetwork, step_s: float) -> None:
        """Add rules by which drivers act beside those of SUMO."""
        sumo, vehicles = self._sumo, [self._spec.vehicles[index] for index in self._sumo.vehicles]
        turns = streets_of(network).for_class("passenger").turns_at_ends()
        ends = [lane for lane in network.lanes.values() if lane.edge in turns]
        ends_m = {lane.edge: lane.length_m * lane.sumo_s_per_m for lane in ends}
        lengths_m = np.array([blueprint_named(vehicle.blueprint).train_length_m for vehicle in vehicles])
        have_way = [self._spec.yields_to_emergency and vehicle.emergency_lights for vehicle in vehicles]
        self._turning_room = TurningRoom(turns, ends_m, lengths_m, sumo)
        self._speed_bumps = SpeedBumps(network.features.speed_bumps, lengths_m, sumo, step_s)
        self._impatience = None if self._spec.drive is None else Impatience(sumo.vehicles)
        self._making_way = MakingWay(have_way, sumo, step_s)

    def drive_vehicle(self, vehicle: int, speed_mps: float, yaw_rate_radps: float) -> None:
        """As in ``StateSource``; without further commands the vehicle brakes after 0.5 s."""
        self._outside_drivers.set_command(vehicle, speed_mps, yaw_rate_radps)

    def follow_command(self, vehicle: int, command: DriverCommand) -> None:
        """As in ``StateSource``."""
        self._outside_drivers.follow_command(vehicle, command)

    def hold_signal(self, head: int, state: SignalState | None) -> int:
        """As in ``StateSource``; the heads show it when the published state has caught up with SUMO."""
        now = self._steps - 1
        if state is None:
            for change in self._signal_heads.release(head, now):
                self._sumo.take_phase(change)
        else:
            self._signal_heads.hold(head, state, now)
        return now + self._actors.delay_ticks - self._spec.warm_up_ticks

    def adopt_entity(self, actor: int, actors: Table) -> None:
        """As in ``StateSource``."""
        if actor not in self.entities:
            self.entities.require_room()
            ids, offsets_m = self._actors.take_out(actor)
            is_there = np.isin(ids, actors["id"])
            self.entities.adopt(actors[np.searchsorted(actors["id"], ids[is_there])], offsets_m[is_there])

    def step(self) -> WorldState:
        """Advance by one tick and return its state.

        The first call returns tick ``-spec.warm_up_ticks`` with all actors at rest; tick 0 follows after the warm-up.

        Raises:
            SimulationError: SUMO failed.
        """
        if self._steps:
            for change in self._signal_heads.advance(self._steps - 1):
                self._sumo.take_phase(change)
            tick = self._steps - self._spec.warm_up_ticks
            self._outside_drivers.move_vehicles(tick, self.weather)
            self._hold_in_warm_up(tick)
            self._turning_room.hold_back()
            self._speed_bumps.slow_down()
            self._making_way.make_way()
            self._place_obstacles()
            self._sumo.step_sumo()
        tick = self._steps - self._spec.warm_up_ticks
        if self._steps % self._ticks_per_second == 0:
            self._sumo.keep_on_routes(
                self._routes, self._steps, self._outside_drivers, detours=bool(self._spec.map.path)
            )
            self._sumo.shorten_closures()
            if self._impatience is not None:
                self._impatience.update(self._ticks_per_second * self._spec.tick_ns / NS_PER_S)
            if not self.weather.is_constant:
                self._adapt_to_rain(tick)
        sample = self._population.sample()
        actors = self._actors.advance_actors(sample, self._steps)
        self.route_events.advance(sample.front_m)
        if self._storyboard is not None:
            if self._storyboard.moves_ego:
                self.adopt_entity(EGO_ID, actors)
            self._storyboard.advance(tick, actors)
        self.entities.advance_entities(self.weather.at(tick))
        actors = self.entities.overlay(actors)
        self.entities.note_contacts(actors)
        signals = self._signal_heads.table_at(self._steps - self._actors.delay_ticks)
        state = WorldState(
            stamp_ns=self._spec.stamp_ns(tick),
            tick=tick,
            ego_id=EGO_ID,
            actors=actors,
            signals=signals if self._storyboard is None else self._storyboard.shown_signals(signals),
            weather=self.weather.at(tick),
            events=(
                *self._actors.events,
                *self.entities.events,
                *self.route_events.events_at(tick, actors),
                *(() if self._storyboard is None else self._storyboard.events),
            ),
        )
        self._steps += 1
        return state

    def _place_obstacles(self) -> None:
        """Let SUMO's traffic heed the entities on its roads, where they will be when the tables catch up with it."""
        ahead_s = self._actors.delay_ticks * self._spec.tick_ns / NS_PER_S
        ground = self._actors.ground

        def is_on_road(position_m: Float64Array) -> bool:
            point_m = position_m[None]
            height_m = float((point_m[:, 2] - ground.heights_m(point_m))[0])
            return bool(ground.is_paved(point_m)[0]) and abs(height_m) < _CLEARANCE_M

        self._sumo.obstacles.place(
            {
                actor: (size_m, motion.position_m, motion.rotation[:, 0])
                for actor, size_m, motion in self.entities.ahead(ahead_s)
                if is_on_road(motion.position_m)
            }
        )

    def _hold_in_warm_up(self, tick: int) -> None:
        """Let the first agent stand at the start of its route until tick 0, as vehicles driven from outside do."""
        start_tick = max(-self._actors.delay_ticks, 2 - self._spec.warm_up_ticks)
        if self._spec.drive is not None and (self._steps == 1 or tick == start_tick):
            self._sumo.limit_speed(self._sumo.vehicles.index(0), "drive", None if tick == start_tick else 0.0)

    def _adapt_to_rain(self, tick: int) -> None:
        effect = rain_effect(self.weather.at(tick))
        for row, index in enumerate(self._sumo.vehicles):
            vehicle = self._spec.vehicles[index]
            self._sumo.adapt_driver(row, vehicle.speed_factor * effect.speed, vehicle.headway_s * effect.headway)

    def close(self) -> None:
        """Stop SUMO; further calls have no effect."""
        self._sumo.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


def _written(folder: Path, inputs: Mapping[str, str]) -> list[Path]:
    """SUMO's input files of a scene, written into a folder; contents are by the kind of file."""
    files = [folder / f"scene.{kind}.xml" for kind in inputs]
    with write_errors(folder):
        for file, text in zip(files, inputs.values(), strict=True):
            file.write_text(text, encoding="utf-8")
    return files
