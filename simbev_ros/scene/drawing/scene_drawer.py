"""Draw the actors around the agents of a scene: hazard areas, vehicles and pedestrians."""

import logging
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from simbev_ros.config.draw import sample
from simbev_ros.config.scenario import Scenario
from simbev_ros.config.traffic import Traffic
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import Blueprint, Clothing, blueprint_named, load_blueprints
from simbev_ros.scene.drawing.draw_agents import DrawnAgents
from simbev_ros.scene.drawing.draw_carriers import on_lanes_near
from simbev_ros.scene.drawing.drivers import draw_driver, draw_vehicle
from simbev_ros.scene.drawing.start_clearance import StartClearance
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.scene.drawing.walking_groups import with_groups
from simbev_ros.scene.gait import transition_mps
from simbev_ros.scene.hazards.detours import Detours
from simbev_ros.scene.hazards.draw_hazards import DrawnHazards, draw_hazards
from simbev_ros.scene.streets.off_tracking import is_long
from simbev_ros.schema.scene.spec import PedestrianSpec, VehicleSpec, WaypointSpec
from simbev_ros.schema.scene.weather import Weather

_LOGGER = logging.getLogger(__name__)
_WARMTHS: tuple[Clothing, ...] = ("cold", "mild", "warm")
_RAIN = 10.0
"""Precipitation, percent, from which people have umbrellas and hoods."""


@dataclass(frozen=True, slots=True)
class SceneDrawer:
    """Draws the actors of one scene; draw the hazards first, then the vehicles, then the pedestrians.

    Attributes:
        scenario: The configuration.
        seed: Seed of the scene.
        network: Roads of the scene's map.
        starts: Positions on them where actors can start.
        duration_s: Duration of the scene with its warm-up.
        agents: The agents, already drawn.
        weather: Weather at the start of the scene, which people dress for.
    """

    scenario: Scenario
    seed: int
    network: RoadNetwork
    starts: StartPositions
    duration_s: float
    agents: DrawnAgents
    weather: Weather

    @property
    def _traffic(self) -> Traffic:
        return self.scenario.traffic

    def draw_hazards(self) -> DrawnHazards:
        """Draw hazard areas at some of the free positions."""
        free = self._free_positions()
        sites = self.starts.hazard_sites(self.scenario.hazards.taper_factor)
        detours = Detours(self.network, self.agents.vehicles, self.starts.vehicles, free)
        return draw_hazards(
            self.scenario.hazards, self.seed, sites, self.starts.vehicles, free, self.agents.start_m, detours
        )

    def draw_vehicles(self, hazards: DrawnHazards, clearance: StartClearance) -> Iterator[VehicleSpec]:
        """Draw vehicles at free positions outside hazard areas, each of a kind that may drive there.

        They occupy their starts in ``clearance``. Fewer than requested, with a warning, if there is no room.
        """
        positions, closed = self.starts.vehicles, hazards.closed_edges
        usable = self.starts.usable(self.duration_s, closed)
        free: Int64Array = np.flatnonzero(self._free_positions(closed) & hazards.free_positions(positions))
        requested = self._vehicle_count(len(free))
        count = min(requested, max(1, round(min(self.starts.capacity(self.duration_s), requested))))
        if count < requested:
            _LOGGER.warning(
                "%s: %d of %d vehicles: more could not keep driving on a map as small as this for %g s",
                *(self.network.name, count, requested, self.duration_s),
            )
        drawn_count = 0
        for position_index in stream(self.seed, "vehicles.places").permutation(free).tolist():
            if drawn_count == count:
                return
            start, rng = positions.waypoint(position_index), stream(self.seed, f"vehicles.{drawn_count}")
            blueprint = _draw_blueprint_with_room(
                tuple(name for name in usable if usable[name][position_index]), start, clearance, rng
            )
            if blueprint is not None:
                driver = draw_driver(self._traffic, blueprint, self.seed, f"vehicles.{drawn_count}")
                vehicle = draw_vehicle(self._traffic, blueprint, start, rng, self._traffic.reckless_probability, driver)
                clearance.occupy(vehicle)
                yield vehicle
                drawn_count += 1
        if drawn_count < count:
            _LOGGER.warning(
                "%s: room for %d of %d vehicles on lanes within spawn_radius_m %g of the ego, at waypoint_spacing_m %g",
                *(self.network.name, drawn_count, count),
                *(self._traffic.spawn_radius_m, self._traffic.waypoint_spacing_m),
            )

    def draw_pedestrians(self, clearance: StartClearance) -> Iterator[PedestrianSpec]:
        """Draw pedestrians on sidewalks around the agents; fewer than requested, with a warning, if they lack room."""
        requested = self._requested_pedestrians()
        candidates = self._pedestrian_positions(clearance)
        if requested > len(candidates):
            _LOGGER.warning(
                "%s: room for %d of %d pedestrians on sidewalks within spawn_radius_m %g of the ego",
                *(self.network.name, len(candidates), requested, self._traffic.spawn_radius_m),
            )
        order = stream(self.seed, "pedestrians.places").permutation(candidates)
        cross_factor, dressed = self.draw_cross_factor(), dressed_for(self.weather, self.seed)
        starts = map(self.starts.pedestrians.waypoint, order[:requested].tolist())
        drawn = (self._draw_pedestrian(index, start, cross_factor, dressed) for index, start in enumerate(starts))
        yield from with_groups(drawn, self.seed, self._traffic.group_probability)

    def draw_cross_factor(self) -> float:
        """Draw the share of the scene's pedestrians that may jaywalk."""
        return sample(self._traffic.walker_cross_factor, stream(self.seed, "pedestrians.cross_factor"))

    def _free_positions(self, closed: frozenset[str] = frozenset()) -> BoolArray:
        """(N,) positions around the agents where vehicles can start, with routes that avoid ``closed`` edges."""
        positions, radius_m = self.starts.vehicles, self._traffic.spawn_radius_m
        return (
            np.any([positions.within_radius(start_m, radius_m) for start_m in self.agents.position_m], axis=0)
            & np.any(list(self.starts.usable(self.duration_s, closed).values()), axis=0)
            & ~on_lanes_near(positions, self.agents.vehicles, self._traffic)
        )

    def _vehicle_count(self, free_count: int) -> int:
        """Draw the number of vehicles for this number of free positions."""
        traffic, rng = self._traffic, stream(self.seed, "vehicles.count")
        if traffic.vehicles == "paper":
            count = int(rng.integers(0, max(free_count - 3, 0), endpoint=True))
        else:
            count = round(sample(traffic.vehicles, rng))
        return count

    def _requested_pedestrians(self) -> int:
        """Draw the number of pedestrians."""
        pedestrians, rng = self._traffic.pedestrians, stream(self.seed, "pedestrians.count")
        if pedestrians == "paper":
            return int(rng.integers(0, 640, endpoint=True))
        return round(sample(pedestrians, rng))

    def _pedestrian_positions(self, clearance: StartClearance) -> Int64Array:
        """Indices of the positions around the agents where pedestrians can start."""
        positions = self.starts.pedestrians
        near = self.starts.walkable_near(self.duration_s, self.agents.position_m, self._traffic.spawn_radius_m)
        candidates = np.flatnonzero(near)
        half_width_m = np.array([lane.width_m for lane in positions.lanes])[positions.row[candidates]] / 2.0
        return candidates[clearance.is_free_at(positions.position_m[candidates], half_width_m)]

    def _draw_pedestrian(
        self, index: int, start: WaypointSpec, cross_factor: float, dressed: tuple[str, ...]
    ) -> PedestrianSpec:
        """Draw the pedestrian with this index, whose blueprint is one of those that are ``dressed`` for the weather."""

        def draw_flag(purpose: str, probability: float) -> bool:
            return bool(stream(self.seed, f"pedestrians.{index}.{purpose}").random() < probability)

        rng = stream(self.seed, f"pedestrians.{index}")
        blueprint = _draw_blueprint("pedestrian", dressed, rng, self._traffic.wheelchair_probability)
        color = blueprint.colors[int(rng.integers(len(blueprint.colors)))]
        max_speed_mps = sample(self._traffic.pedestrian_max_speed_mps, rng)
        if blueprint.fast and max_speed_mps > blueprint.max_speed_mps:
            blueprint = blueprint_named(blueprint.fast)
        if blueprint.runs_as and max_speed_mps > transition_mps(blueprint.tall_m):
            blueprint = blueprint_named(blueprint.runs_as)
            rng = stream(self.seed, f"pedestrians.{index}.sports")
            color = blueprint.colors[int(rng.integers(len(blueprint.colors)))]
        return PedestrianSpec(
            blueprint=blueprint.name,
            color=color,
            start=start,
            max_speed_mps=min(max_speed_mps, blueprint.max_speed_mps or math.inf),
            # Wheelchair users do not cross curbs.
            jaywalks=not blueprint.wheelchair and draw_flag("jaywalks", cross_factor),
            visits_plazas=max_speed_mps <= transition_mps(blueprint.tall_m)
            and draw_flag("plazas", self._traffic.plaza_probability),
        )


def dressed_for(weather: Weather, seed: int) -> tuple[str, ...]:
    """Names of the pedestrians' blueprints that suit a weather and the warmth of the scene, which is drawn."""
    warmth = _WARMTHS[int(stream(seed, "pedestrians.warmth").integers(len(_WARMTHS)))]
    rains = weather.precipitation > _RAIN
    suited: tuple[Clothing, ...] = ("mild" if warmth == "warm" else warmth, "rain") if rains else (warmth,)
    return tuple(each.name for each in load_blueprints() if each.kind == "pedestrian" and each.suits(suited))


def _draw_blueprint_with_room(
    names: tuple[str, ...], start: WaypointSpec, clearance: StartClearance, rng: np.random.Generator
) -> Blueprint | None:
    """Draw one of these blueprints; if it does not fit, a short one; None if that does not fit either."""
    short = tuple(name for name in names if not is_long(blueprint_named(name)))
    for allowed in (names, short):
        if allowed and clearance.is_free(blueprint := _draw_blueprint("vehicle", allowed, rng), start):
            return blueprint
    return None


def _draw_blueprint(
    kind: str, names: tuple[str, ...] | None, rng: np.random.Generator, wheelchairs: float | None = None
) -> Blueprint:
    """Draw a blueprint of a kind, among these names (None: all), weighted by frequency.

    ``wheelchairs`` is the share of those with wheelchairs; None: as their frequency says.
    """
    blueprints, shares = _frequencies(kind, names, wheelchairs)
    return blueprints[int(np.searchsorted(shares, rng.random(), side="right"))]


@cache
def _frequencies(
    kind: str, names: tuple[str, ...] | None, wheelchairs: float | None
) -> tuple[list[Blueprint], Float64Array]:
    """The blueprints to choose from, and their (B,) cumulative share of all draws."""
    blueprints = [each for each in load_blueprints() if each.kind == kind and (names is None or each.name in names)]
    weights = np.array([blueprint.frequency for blueprint in blueprints])
    if wheelchairs is not None:
        has_wheelchair = np.array([blueprint.wheelchair for blueprint in blueprints])
        weights[has_wheelchair] *= wheelchairs / weights[has_wheelchair].sum()
        weights[~has_wheelchair] *= (1.0 - wheelchairs) / weights[~has_wheelchair].sum()
    cumulative = np.cumsum(weights)
    return blueprints, cumulative / cumulative[-1]
