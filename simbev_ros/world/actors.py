"""All actors over time: SUMO's samples in, the actors table out, of the same moment for everything in it."""

import logging
from collections import deque
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import shapely

from simbev_ros.errors import SimulationError
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.spec import NS_PER_S, PedestrianSpec, SceneSpec, VehicleSpec
from simbev_ros.scene.state import Event
from simbev_ros.types import Int64Array, Table
from simbev_ros.world.cast import cast_of, first_prop_id
from simbev_ros.world.doors import Doors
from simbev_ros.world.kinematics.collisions import Impact
from simbev_ros.world.kinematics.footing import Footing
from simbev_ros.world.kinematics.ground import Ground
from simbev_ros.world.kinematics.motion import Motion
from simbev_ros.world.leading_points import LeadingPoints
from simbev_ros.world.lights import HAZARD_LIGHTS
from simbev_ros.world.pedestrians.excursions import Excursions
from simbev_ros.world.pedestrians.itineraries import Leg
from simbev_ros.world.population import Population
from simbev_ros.world.props import prop_obstacles, prop_rows
from simbev_ros.world.sumo.traffic import TrafficSample
from simbev_ros.world.table import ActorTable

_LOGGER = logging.getLogger(__name__)
_HALF_WINDOW_S = 0.35
_GROUND_MARGIN_M = 50.0


class Actors:
    """The cast of a scene in motion.

    Attributes:
        events: Those of the latest table.
    """

    def __init__(
        self,
        spec: SceneSpec,
        network: RoadNetwork,
        traffic: Population,
        obstacles: Table,
        excursions: Mapping[int, tuple[Leg, ...]],
    ) -> None:
        """At rest, where SUMO has placed everybody.

        Args:
            spec: The scene.
            network: Its roads.
            traffic: SUMO.
            obstacles: (K,) ``OBSTACLE_DTYPE``, what people walk around.
            excursions: The ways of those pedestrians of the specification who leave SUMO's net.

        Raises:
            SimulationError: the ego found no place.
        """
        self.events: tuple[Event, ...] = ()
        self._coming_events: tuple[Event, ...] = ()
        self._traffic = traffic
        tick_s = spec.tick_ns / NS_PER_S
        _report_missing(spec, traffic)
        sample, directions, vehicles = traffic.sample(), traffic.directions(), len(traffic.vehicles)
        self._excursions = Excursions(spec, excursions, traffic, sample.front_m)
        pedestrian_m, directions[vehicles:] = self._excursions.at_start(sample.pedestrian_m, directions[vehicles:])
        sample = replace(sample, pedestrian_m=pedestrian_m)
        self._ground = _ground(spec, network, sample)
        self._props = prop_rows(spec, first_prop_id(spec), self._ground)
        obstacles = np.concatenate([obstacles, prop_obstacles(self._props, network, self._ground)])
        cast = cast_of(spec, traffic.vehicles, traffic.pedestrians)
        self._ids: Int64Array = cast.rows["id"][cast.rows["parent"] == 0].astype(np.int64)
        self._half_length_m = cast.bodies.boxes.size_m[:, 0] / 2.0
        self._leading = LeadingPoints(
            spec, traffic, cast.bodies, self._excursions, self._ground, obstacles, sample, directions
        )
        self._motion = Motion(
            cast.bodies,
            self._leading.now,
            directions,
            tick_s,
            max(1, round(_HALF_WINDOW_S / tick_s)),
            None if self._ground.is_level else Footing(self._ground, cast.bodies.contacts),
        )
        # The oldest entry is of the tick that the kinematics are of.
        length = self.delay_ticks + 1
        self._doors = Doors(spec, traffic, sample.front_m, self.delay_ticks)
        self._signals = deque([sample.signals] * length, maxlen=length)
        self._jaywalking = deque([self._excursions.jaywalking.copy()] * length, maxlen=length)
        self._table = ActorTable(spec, cast, vehicles)

    @property
    def ground(self) -> Ground:
        """What everybody stands on."""
        return self._ground

    @property
    def delay_ticks(self) -> int:
        """How many ticks the tables are behind SUMO."""
        return self._motion.delay_ticks

    def advance(self, sample: TrafficSample, step: int) -> Table:
        """(N,) ``ACTOR_DTYPE``, one tick on; ``step`` counts the ticks since the scene's start."""
        self._signals.append(sample.signals)
        vehicles, crashed = len(sample.signals), self._motion.collisions.crashed.copy()
        self._leading.advance(sample, crashed)
        points = self._leading.now
        # Bodies lag behind their points: who is across already may have metres to go to the kerb.
        crossing = self._excursions.jaywalking | self._jaywalking[-1]
        self._jaywalking.append(crossing & (points[vehicles:, 3] == 0.0))
        motion = self._motion.advance(points)
        self.events = self._coming_events  # the collisions known now are among the poses of the next table
        self._coming_events = tuple(map(self._event, self._motion.collisions.impacts))
        self._hold()
        doors = self._doors.advance(sample.front_m, step)
        signals = self._signals[0] | np.where(crashed[:vehicles], HAZARD_LIGHTS, 0)
        return np.concatenate([self._table.at(motion, signals, doors, self._jaywalking[0], step), self._props])

    def _event(self, impact: Impact) -> Event:
        a, b = sorted(int(self._ids[body]) for body in impact.bodies)
        x_m, y_m, z_m = impact.position_m.tolist()
        return Event("collision", (a, b), (x_m, y_m, z_m), impact.relative_speed_mps)

    def _hold(self) -> None:
        """Let SUMO know where those who have just collided will stand, so that the others queue or go around."""
        collisions = self._motion.collisions
        self._leading.rest(collisions)
        for body in sorted({body for impact in collisions.impacts for body in impact.bodies}):
            yaw_rad = float(collisions.yaw_rad[body])
            ahead = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
            front_m = collisions.rest_m[body] + self._half_length_m[body] * ahead
            self._traffic.crash(body, front_m, yaw_rad)


def _ground(spec: SceneSpec, network: RoadNetwork, sample: TrafficSample) -> Ground:
    """What can be reached; the sidewalks that people can reach are there from the beginning."""
    ground = Ground(network.layout.near(_reached(spec, network, sample), _GROUND_MARGIN_M))
    fastest_mps = max((person.max_speed_mps for person in spec.pedestrians), default=0.0)
    ground.prepare(sample.pedestrian_m, fastest_mps * (spec.warm_up_ticks + spec.ticks) * spec.tick_ns / NS_PER_S)
    return ground


def _reached(spec: SceneSpec, network: RoadNetwork, sample: TrafficSample) -> shapely.Polygon:
    """A rectangle that nobody leaves during the scene."""
    places_m = np.concatenate([sample.front_m, sample.pedestrian_m])[:, :2]
    # An ego that is driven from outside may be as fast as the limit, whatever its own factor.
    boldest = max(1.0, *(vehicle.speed_factor for vehicle in spec.vehicles))
    fastest_mps = max(lane.speed_mps for lane in network.lanes.values()) * boldest
    way_m = fastest_mps * (spec.warm_up_ticks + spec.ticks) * spec.tick_ns / NS_PER_S
    area: shapely.Polygon = shapely.box(*(places_m.min(axis=0) - way_m), *(places_m.max(axis=0) + way_m))
    return area


def _report_missing(spec: SceneSpec, traffic: Population) -> None:
    """Log who found no place; the ego must have found one."""
    if 0 not in traffic.vehicles:
        raise SimulationError(f"{spec.name}: the ego finds no place at its start, {_place(spec.vehicles[0])}")
    for kind, wanted, present in (
        ("vehicle", spec.vehicles, traffic.vehicles),
        ("pedestrian", spec.pedestrians, traffic.pedestrians),
    ):
        for index in sorted(set(range(len(wanted))) - set(present)):
            _LOGGER.warning("%s: %s %d is left out; no place at %s", spec.name, kind, index, _place(wanted[index]))


def _place(actor: VehicleSpec | PedestrianSpec) -> str:
    return f"lane {actor.start.lane}, {actor.start.s_m:.1f} m"
