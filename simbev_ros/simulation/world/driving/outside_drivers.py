"""Agents' vehicles that outside nodes drive: commands in, moves of SUMO's vehicles out, one driver per vehicle."""

from collections.abc import Callable

from simbev_ros.foundation.types import Float64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.weather_course import WeatherCourse
from simbev_ros.schema.scene.drive_spec import Command
from simbev_ros.schema.scene.route_progress import RouteProgress
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.world.driving.commands import DriverCommand, IndicatorsCommand
from simbev_ros.simulation.world.driving.driven_vehicles import CommandedDriver, EgoDriver
from simbev_ros.simulation.world.driving.vehicle_model import road_friction
from simbev_ros.simulation.world.lights import LEFT_BLINKER, RIGHT_BLINKER
from simbev_ros.simulation.world.sumo.traffic import SumoTraffic

_BLINKERS = {
    **dict.fromkeys((Command.LEFT, Command.CHANGE_LEFT), LEFT_BLINKER),
    **dict.fromkeys((Command.RIGHT, Command.CHANGE_RIGHT), RIGHT_BLINKER),
}
_INDICATED_M, _INDICATED_S = 30.0, 3.0
"""Indicators are on 100 feet before a turn (Uniform Vehicle Code, 11-604), and 3 s before a maneuver (UN R79)."""


def driven_from_outside(spec: SceneSpec) -> frozenset[int]:
    """Indices in ``spec.vehicles`` of the vehicles that outside nodes drive."""
    return frozenset(agent.vehicle for agent in spec.agents if agent.vehicle is not None and agent.driver != "traffic")


def driven_by_commands(spec: SceneSpec) -> frozenset[int]:
    """Indices in ``spec.vehicles`` of those of them that follow stamped commands with the dynamic vehicle model."""
    twisted = {agent.vehicle for agent in spec.agents if agent.driver == "twist"}
    return driven_from_outside(spec) - twisted


class OutsideDrivers:
    """Drivers of the vehicles that outside nodes drive; contains the indices of these vehicles in ``spec.vehicles``."""

    def __init__(
        self,
        spec: SceneSpec,
        network: RoadNetwork,
        sumo: SumoTraffic,
        heights_m: Callable[[Float64Array], Float64Array],
        delay_ticks: int = 0,
    ) -> None:
        """Start at rest, where SUMO has placed the vehicles.

        The speed limit of a vehicle is that of the fastest road, times its own speed factor if that is above 1.

        Args:
            spec: The scene.
            network: Its roads.
            sumo: SUMO's traffic.
            heights_m: Function from (N, 3) points, roughly at road height, to the (N,) heights of the road.
            delay_ticks: Number of ticks by which poses are published later: planned times are those of published poses.
        """
        self._sumo, self._delay_ticks = sumo, delay_ticks
        self._drivers: dict[int, EgoDriver | CommandedDriver] = {}
        self._progress = None if spec.drive is None else RouteProgress(spec.drive.route)
        self._is_indicated_by_driver = set[int]()
        self._spec, by_commands = spec, driven_by_commands(spec)
        driven = driven_from_outside(spec)
        if not driven:  # an extra sample would shift the ticks at which SUMO's lanes ahead are refreshed
            return
        fastest_mps = max(lane.speed_mps for lane in network.lanes.values())
        for row, (index, front_m) in enumerate(zip(sumo.vehicles, sumo.sample().front_m, strict=True)):
            if index in driven:
                vehicle = spec.vehicles[index]
                blueprint = blueprint_named(vehicle.blueprint)
                driver = CommandedDriver if index in by_commands else EgoDriver
                self._drivers[index] = driver(
                    blueprint,
                    front_m,
                    sumo.direction(row),
                    min(blueprint.max_speed_mps, fastest_mps * max(vehicle.speed_factor, 1.0)),
                    spec.tick_ns / NS_PER_S,
                    heights_m,
                )

    def __contains__(self, vehicle: object) -> bool:
        return vehicle in self._drivers

    def set_command(self, vehicle: int, speed_mps: float, yaw_rate_radps: float) -> None:
        """Set the desired motion of a vehicle as in ``EgoDriver``; ignored for vehicles that others drive."""
        if isinstance(driver := self._drivers.get(vehicle), EgoDriver):
            driver.set_command(speed_mps, yaw_rate_radps)

    def follow_command(self, vehicle: int, command: DriverCommand) -> None:
        """Let a vehicle follow a command; ignored for vehicles that follow none."""
        if not isinstance(driver := self._drivers.get(vehicle), CommandedDriver):
            return
        if isinstance(command, IndicatorsCommand):
            self._is_indicated_by_driver.add(vehicle)
            bits = command.left * LEFT_BLINKER | command.right * RIGHT_BLINKER
            self._sumo.given.blinkers[self._sumo.vehicles.index(vehicle)] = bits
        else:
            driver.follow(command)

    def move_vehicles(self, tick: int, weather: WeatherCourse) -> None:
        """Drive for one tick, the one that leads to ``tick``; call it before each step of SUMO.

        Raises:
            SimulationError: SUMO failed.
        """
        for vehicle, driver in self._drivers.items():
            if isinstance(driver, CommandedDriver):
                friction = road_friction(weather.at(tick), with_snow=self._spec.drive is not None)
                driver.advance_tick(self._spec.stamp_ns(tick - 1 + self._delay_ticks), friction)
                self._indicate(vehicle, driver)
            else:
                driver.advance_tick()
            self._sumo.move_vehicle(self._sumo.vehicles.index(vehicle), driver.front_m, driver.axle_m)

    def _indicate(self, vehicle: int, driver: CommandedDriver) -> None:
        """Indicate the maneuver of the route that the first agent is in, or that is near, until its driver does so."""
        if self._progress is not None and vehicle == 0 and vehicle not in self._is_indicated_by_driver:
            command, ahead_m = self._progress.next_command(self._progress.advance_to(driver.front_m))
            is_near = ahead_m <= max(_INDICATED_M, _INDICATED_S * driver.model.speed_mps)
            self._sumo.given.blinkers[self._sumo.vehicles.index(0)] = _BLINKERS.get(command, 0) if is_near else 0
