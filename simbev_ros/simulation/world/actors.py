"""All actors over time: SUMO's samples in, one actors table per tick out, every column of the same moment."""

import logging
from collections import deque
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import shapely

from simbev_ros.foundation.errors import SimulationError
from simbev_ros.foundation.latest_value import LatestValue
from simbev_ros.foundation.types import Float64Array, Int64Array, Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.weather_course import WeatherCourse
from simbev_ros.schema.scene.agents import agent_views
from simbev_ros.schema.scene.spec import PedestrianSpec, SceneSpec, VehicleSpec
from simbev_ros.schema.scene.state import COLLISION, Event
from simbev_ros.simulation.world.cast import Cast, cast_of, first_prop_id
from simbev_ros.simulation.world.doors import Doors
from simbev_ros.simulation.world.driving.outside_drivers import driven_by_commands
from simbev_ros.simulation.world.kinematics.collisions import Impact
from simbev_ros.simulation.world.kinematics.footing import GroundPlanes
from simbev_ros.simulation.world.kinematics.ground import GroundSurface
from simbev_ros.simulation.world.kinematics.motion import Motion
from simbev_ros.simulation.world.kinematics.raised_areas import RaisedAreas
from simbev_ros.simulation.world.leading_points import LeadingPoints
from simbev_ros.simulation.world.lights import HAZARD_LIGHTS
from simbev_ros.simulation.world.parked import ParkedVehicles
from simbev_ros.simulation.world.pedestrians.excursions import Excursions
from simbev_ros.simulation.world.pedestrians.itineraries import Leg
from simbev_ros.simulation.world.population import Population
from simbev_ros.simulation.world.props import prop_obstacles, prop_rows
from simbev_ros.simulation.world.resting import resting_obstacles, resting_people
from simbev_ros.simulation.world.sumo.traffic import TrafficSample
from simbev_ros.simulation.world.table import ActorTable
from simbev_ros.simulation.world.wrecks import Wrecks

_LOGGER = logging.getLogger(__name__)
_HALF_WINDOW_S = 0.35
_GROUND_MARGIN_M = 50.0


class Actors:
    """The moving actors, the static props, the parked vehicles and the people who rest in a scene.

    Attributes:
        events: Events of the latest table.
    """

    def __init__(
        self,
        spec: SceneSpec,
        network: RoadNetwork,
        population: Population,
        obstacles: Table,
        excursions: Mapping[int, tuple[Leg, ...]],
        weather: WeatherCourse,
        parking_spots: Table,
        rests: Table,
    ) -> None:
        """Start at rest, where SUMO has placed the actors.

        Args:
            spec: The scene.
            network: Its roads.
            population: Vehicles and pedestrians.
            obstacles: (K,) ``OBSTACLE_DTYPE``, which pedestrians walk around.
            excursions: Legs of the pedestrians that leave SUMO's network, by their index in the specification.
            weather: Weather at each tick.
            parking_spots: (S,) ``SPOT_DTYPE``.
            rests: (R,) ``REST_DTYPE``.

        Raises:
            SimulationError: An agent's vehicle could not be placed.
        """
        self.events: tuple[Event, ...] = ()
        self._coming_events: tuple[Event, ...] = ()
        self._population = population
        _report_missing(spec, population)
        sample, directions, vehicles = population.sample(), population.directions(), len(population.vehicles)
        self._excursions = Excursions(spec, excursions, population, sample.front_m)
        pedestrian_m, directions[vehicles:] = self._excursions.start_poses(sample.pedestrian_m, directions[vehicles:])
        sample = replace(sample, pedestrian_m=pedestrian_m)
        self._pedestrian_start_m = pedestrian_m
        self._ground = _ground(spec, network, sample)
        self._props = prop_rows(spec, first_prop_id(spec), self._ground)
        first_parked_id = first_prop_id(spec) + len(self._props)
        self._parked = ParkedVehicles(spec, network, parking_spots, excursions, first_parked_id)
        self._resting = resting_people(spec, network, rests, excursions, first_parked_id + len(self._parked.rows))
        self._free_id = first_parked_id + len(self._parked.rows) + len(self._resting)
        props = prop_obstacles(self._props, network, self._ground)
        obstacles = np.concatenate([obstacles, props, resting_obstacles(self._resting, self._ground)])
        cast = cast_of(spec, population.vehicles, population.pedestrians)
        self._start_bodies(spec, cast, obstacles, sample, directions)
        self._table = ActorTable(spec, weather, cast, vehicles, Tunnels.of_layout(network.layout))

    def _start_bodies(
        self, spec: SceneSpec, cast: Cast, obstacles: Table, sample: TrafficSample, directions: Float64Array
    ) -> None:
        """Set what moves the bodies of a cast, and the queues that are as late as it is."""
        population, tick_s = self._population, spec.tick_ns / NS_PER_S
        self._ids: Int64Array = np.append(cast.rows["id"][cast.rows["parent"] == 0], self._parked.rows["id"])
        self._point = cast.bodies.point
        self._wrecks = Wrecks(spec, population, cast.bodies)
        self._towing, self._towed = cast.bodies.towing, cast.bodies.towed
        self._cast_rows, self._mount_m = cast.rows, cast.bodies.mount_m
        self._half_length_m = cast.bodies.boxes.size_m[:, 0] / 2.0
        self._leading = LeadingPoints(
            spec, population, cast.bodies, self._excursions, self._ground, obstacles, sample, directions
        )
        self._motion = Motion(
            cast.bodies,
            self._leading.now,
            directions,
            tick_s,
            max(1, round(_HALF_WINDOW_S / tick_s)),
            None if self._ground.is_level else GroundPlanes(self._ground, cast.bodies.contacts),
            self._leading.axle_m,
            self._parked.rows,
            [row for row, index in enumerate(population.vehicles) if index in driven_by_commands(spec)],
        )
        # The oldest entry belongs to the same tick as the kinematics.
        length = self.delay_ticks + 1
        self._doors = Doors(spec, population.vehicles, population.sumo, sample.front_m, self.delay_ticks)
        self._signals = deque([sample.signals] * length, maxlen=length)
        self._jaywalking = deque([self._excursions.jaywalking.copy()] * length, maxlen=length)

    @property
    def ground(self) -> GroundSurface:
        """The ground surface under all actors."""
        return self._ground

    @property
    def free_id(self) -> int:
        """The first id that no actor of the scene has."""
        return self._free_id

    @property
    def delay_ticks(self) -> int:
        """Number of ticks by which the tables are behind SUMO."""
        return self._motion.delay_ticks

    @property
    def commanded_delay_ticks(self) -> int:
        """Likewise for vehicles that follow commands."""
        return self._motion.unsmoothed_delay_ticks

    def advance_actors(self, sample: TrafficSample, step: int) -> Table:
        """Advance by one tick; returns (N,) ``ACTOR_DTYPE``. ``step`` counts the ticks since the scene's start."""
        self._signals.append(sample.signals)
        bodies = len(self._half_length_m)  # without the parked vehicles
        vehicles, crashed = len(sample.signals), self._motion.collisions.crashed[:bodies].copy()
        self._leading.advance_points(sample, crashed)
        points = self._leading.now
        # Bodies lag behind their points: when the point is across, the body may still be meters from the curb.
        crossing = self._excursions.jaywalking | self._jaywalking[-1]
        self._jaywalking.append(crossing & (points[vehicles:, 3] == 0.0))
        motion = self._motion.advance_motion(points, self._leading.axle_m)
        self.events = self._coming_events  # collisions that are detected now belong to the next table
        self._coming_events = tuple(map(self._event, self._motion.collisions.impacts))
        removed = self._wrecks.removed.copy()  # those that are removed now are not in the next table
        if len(due := self._wrecks.due(crashed)):
            self._motion.collisions.remove(due)
        self._hold_crashed()
        doors = self._doors.advance_doors(sample.front_m, step)
        signals = self._signals[0] | np.where(crashed[:vehicles], HAZARD_LIGHTS, 0)
        moving = self._table.fill(motion, signals, doors, self._jaywalking[0], step)
        moving = moving[~removed[self._point]] if removed.any() else moving
        # without a dtype, NumPy would promote the columns one by one
        still = (self._props, self._parked.rows_at(step, moving), self._resting)
        return np.concatenate([moving, *still], dtype=moving.dtype)

    def hold_pedestrian(self, row: int) -> Float64Array:
        """Let a pedestrian stand where it starts, off SUMO's network; returns this (3,) position."""
        self._excursions.hold(row, self._pedestrian_start_m[row])
        return self._pedestrian_start_m[row]

    def walk_across(self, row: int, goal_m: tuple[float, float]) -> None:
        """Let a held pedestrian walk straight to a position, heedless of vehicles."""
        self._excursions.walk_across(row, np.array(goal_m))

    def open_doors(self, vehicle: int, doors: int) -> None:
        """Open doors of a vehicle that stands for the whole scene, given as bits."""
        self._doors.open_for_good(vehicle, doors)

    def take_out(self, actor: int) -> tuple[Int64Array, Float64Array]:
        """Take an actor out of traffic and collisions for good.

        Returns:
            (1 + K,) ids of the actor and of what it carries or tows, and (1 + K, 3) where these are in its frame.
        """
        rows = np.flatnonzero(self._cast_rows["id"] == actor)
        if not len(rows):  # a parked vehicle, a prop or a person who rests
            collisions, parked = self._motion.collisions, np.flatnonzero(self._parked.rows["id"] == actor)
            collisions.remove(len(self._half_length_m) + parked)
            return np.array([actor], np.int64), np.zeros((1, 3))
        body = int(self._point[rows[0]])
        riders = np.flatnonzero(self._cast_rows["parent"] == actor)
        units = np.flatnonzero(self._towing.leader == body) if body < self._towed.start else riders[:0]
        towed = self._towed.start + units
        bodies = np.append(body, towed)
        gone = bodies[~self._wrecks.removed[bodies]]
        self._wrecks.clear(gone)
        self._motion.collisions.remove(gone)
        own = [rows[0], *riders, *np.flatnonzero(np.isin(self._point, towed))]
        offsets_m = np.zeros((len(own), 3))
        offsets_m[1 : 1 + len(riders)] = self._mount_m[riders]
        models = [load_blueprints()[int(self._cast_rows["blueprint"][row])] for row in own]
        offsets_m[1 + len(riders) :, 0] = [models[0].hitch_m - each.hitch_m for each in models[1 + len(riders) :]]
        return self._cast_rows["id"][own].astype(np.int64), offsets_m

    def _event(self, impact: Impact) -> Event:
        a, b = sorted(int(self._ids[body]) for body in impact.bodies)
        x_m, y_m, z_m = impact.position_m.tolist()
        return Event(COLLISION, (a, b), (x_m, y_m, z_m), impact.relative_speed_mps)

    def _hold_crashed(self) -> None:
        """Mark in SUMO where newly crashed actors will come to rest, so that others queue or drive around them."""
        collisions = self._motion.collisions
        self._leading.rest_crashed(collisions)
        hit = {body for impact in collisions.impacts for body in impact.bodies if body < len(self._half_length_m)}
        towed = self._towed
        bodies = {
            int(self._towing.leader[body - towed.start]) if towed.start <= body < towed.stop else body for body in hit
        }
        for body in sorted(bodies):
            yaw_rad = float(collisions.yaw_rad[body])
            ahead = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
            front_m = collisions.rest_m[body] + self._half_length_m[body] * ahead
            known = body if body < towed.start else body - (towed.stop - towed.start)  # SUMO knows no towed units
            self._population.hold_crashed(known, front_m, yaw_rad)


_grounds = LatestValue[Layout, GroundSurface]()
"""The ground of the latest scene."""

_raised_areas = LatestValue[Layout, RaisedAreas]()
"""The sidewalks of the latest map."""


def _ground(spec: SceneSpec, network: RoadNetwork, sample: TrafficSample) -> GroundSurface:
    """The ground that actors can reach; prepares the sidewalks that pedestrians can reach."""
    layout = network.layout.near(_reachable_area(spec, network, sample), _GROUND_MARGIN_M)
    if _sizes(layout) == _sizes(network.layout):  # nothing is left out
        layout = network.layout
    raised = _raised_areas.get(network.layout, lambda: RaisedAreas.of_map(network))
    ground = _grounds.get(layout, lambda: GroundSurface(layout, raised))
    max_speed_mps = max((pedestrian.max_speed_mps for pedestrian in spec.pedestrians), default=0.0)
    ground.prepare(sample.pedestrian_m, max_speed_mps * (spec.warm_up_ticks + spec.ticks) * spec.tick_ns / NS_PER_S)
    return ground


def _sizes(layout: Layout) -> tuple[int, ...]:
    return len(layout.strips), len(layout.crosswalks), len(layout.stop_lines)


def _reachable_area(spec: SceneSpec, network: RoadNetwork, sample: TrafficSample) -> shapely.Polygon:
    """A rectangle that no actor leaves during the scene."""
    positions_m = np.concatenate([sample.front_m, sample.pedestrian_m])[:, :2]
    # A vehicle driven from outside may drive at the speed limit, whatever its own speed factor.
    max_speed_factor = max(1.0, *(vehicle.speed_factor for vehicle in spec.vehicles))
    max_speed_mps = max(lane.speed_mps for lane in network.lanes.values()) * max_speed_factor
    max_distance_m = max_speed_mps * (spec.warm_up_ticks + spec.ticks) * spec.tick_ns / NS_PER_S
    return shapely.box(*(positions_m.min(axis=0) - max_distance_m), *(positions_m.max(axis=0) + max_distance_m))


def _report_missing(spec: SceneSpec, population: Population) -> None:
    """Log the actors that could not be placed; raise if the vehicle of an agent is one of them."""
    for view in agent_views(spec):
        if view.vehicle is not None and view.spec.vehicle not in population.vehicles:
            start = _describe_start(view.vehicle)
            raise SimulationError(f"{spec.name}: agent {view.agent} does not fit at its start, {start}")
    for kind, requested, present in (
        ("vehicle", spec.vehicles, population.vehicles),
        ("pedestrian", spec.pedestrians, population.pedestrians),
    ):
        for index in sorted(set(range(len(requested))) - set(present)):
            _LOGGER.warning(
                "%s: %s %d is left out; no room at %s", spec.name, kind, index, _describe_start(requested[index])
            )


def _describe_start(actor: VehicleSpec | PedestrianSpec) -> str:
    return f"lane {actor.start.lane}, {actor.start.s_m:.1f} m"
