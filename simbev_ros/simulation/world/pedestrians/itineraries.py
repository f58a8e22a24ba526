"""Itineraries of a scene's pedestrians: legs along sidewalks and crosswalks, with excursions between them.

On an excursion, a jaywalker crosses a street, or a visitor visits a plaza.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from simbev_ros.assets.land.plazas import Plaza
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.streets.walks import WalkGraph
from simbev_ros.schema.scene.hazard import HazardSpec
from simbev_ros.schema.scene.spec import PedestrianSpec
from simbev_ros.simulation.world.pedestrians.crossing_sites import CrossingSite, CrossingSites
from simbev_ros.simulation.world.pedestrians.plaza_visits import PlazaVisit, PlazaVisits

_CROSSING_PROBABILITY = 0.35  # probability that a jaywalker crosses the street along a sidewalk
_START_AT_STOP_PROBABILITY = 0.5  # probability that a visitor who would visit a plaza at once is already there
_OVERSHOOT_M = 4.0  # distance of the walk's end beyond the point where it is left, so that nobody reaches the end
_END_MARGIN_M = 0.5  # minimum distance from the ends of an edge


@dataclass(frozen=True, slots=True)
class Leg:
    """A walk on SUMO's edges.

    Attributes:
        edges: All edges of the walk.
        excursion: Crossing or plaza visit for which the walk is left; None: it outlasts the scene.
        arrival_m: SUMO's position on the last edge where the walk would end; None: anywhere.
        starts_at_stop: Whether the scene starts while the pedestrian stops on the plaza.
        passes: Number of times that the last edge is walked up and down after that, where nothing else can be reached.
    """

    edges: tuple[str, ...]
    excursion: CrossingSite | PlazaVisit | None = None
    arrival_m: float | None = None
    starts_at_stop: bool = False
    passes: int = 0


class ItineraryStreams(NamedTuple):
    """Random generators of one pedestrian: for its destinations, its crossings of streets, and its plaza visits."""

    walk: np.random.Generator
    crossings: np.random.Generator
    plazas: np.random.Generator


class Itineraries:
    """Draws the itineraries of pedestrians on a network."""

    def __init__(self, network: RoadNetwork, hazards: Sequence[HazardSpec] = (), plazas: Sequence[Plaza] = ()) -> None:
        """For a network; pedestrians keep off its hazard areas and visit these plazas."""
        self._network = network
        self._walks = WalkGraph(network)
        self._crossing_sites = CrossingSites(network, hazards)
        self._visits = PlazaVisits(network, plazas)

    def draw_legs(self, pedestrian: PedestrianSpec, length_m: float, streams: ItineraryStreams) -> tuple[Leg, ...]:
        """Draw one pedestrian's itinerary: one leg, or several with excursions between them.

        Args:
            pedestrian: The pedestrian.
            length_m: Maximum distance that it walks during the scene.
            streams: Its random generators.
        """
        edge = self._network.lanes[pedestrian.start.lane].edge
        start_m: float | None = pedestrian.start.s_m
        legs: list[Leg] = []
        while True:
            edges = self._walks.draw_walk(edge, max(length_m, 1.0), streams.walk)
            leg, walked_m = self._draw_leg(pedestrian, edges, start_m, length_m, streams)
            legs.append(leg)
            if leg.excursion is None:
                return tuple(legs)
            edge, start_m = leg.excursion.end_edge, None
            length_m -= walked_m + leg.excursion.length_m

    def _draw_leg(
        self,
        pedestrian: PedestrianSpec,
        edges: tuple[str, ...],
        start_m: float | None,
        length_m: float,
        streams: ItineraryStreams,
    ) -> tuple[Leg, float]:
        """Draw a leg along these edges up to the first excursion; also returns its minimum length.

        ``start_m`` is the distance along the first sidewalk where the leg starts; it may be left at once. None: the
        previous excursion has just ended there.
        """
        if start_m is not None:
            excursion = self._draw_excursion(pedestrian, edges[0], start_m - length_m, start_m + length_m, streams)
            if excursion is not None:
                beyond_m = float(np.copysign(_OVERSHOOT_M, excursion.position_m - start_m))
                arrival_m = min(
                    max(excursion.position_m + beyond_m, _END_MARGIN_M),
                    self._crossing_sites.length_m(edges[0]) - _END_MARGIN_M,
                )
                starts_at_stop = (
                    isinstance(excursion, PlazaVisit) and streams.plazas.random() < _START_AT_STOP_PROBABILITY
                )
                return Leg(edges[:1], excursion, arrival_m, starts_at_stop), 0.0
        walked_m = 0.0
        for edge in edges[1:]:
            excursion = self._draw_excursion(pedestrian, edge, 0.0, np.inf, streams)
            if excursion is not None:
                return Leg(edges, excursion), walked_m
            walked_m += self._crossing_sites.length_m(edge)
            if walked_m > length_m:
                return Leg(edges), walked_m
        return Leg(edges, passes=2 + int(length_m / self._crossing_sites.length_m(edges[-1]))), walked_m

    def _draw_excursion(
        self, pedestrian: PedestrianSpec, edge: str, min_m: float, max_m: float, streams: ItineraryStreams
    ) -> CrossingSite | PlazaVisit | None:
        """Draw the excursion from an edge's sidewalk, between two distances along it; None: there is none."""
        visit = self._visits.draw_visit(edge, min_m, max_m, streams.plazas) if pedestrian.visits_plazas else None
        if visit is not None or not pedestrian.jaywalks:
            return visit
        from_m, to_m = self._crossing_sites.stations_m(edge)
        min_m, max_m = max(min_m, from_m), min(max_m, to_m)
        if min_m < max_m and streams.crossings.random() < _CROSSING_PROBABILITY:
            return self._crossing_sites.site_at(edge, float(streams.crossings.uniform(min_m, max_m)))
        return None
