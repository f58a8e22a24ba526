"""Where people walk in a scene: along sidewalks and crosswalks, and off these between such walks.

Jaywalkers cross streets, and others visit plazas.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from simbev_ros.assets.land.plazas import Plaza
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.hazards.hazard import HazardSpec
from simbev_ros.scene.spec import PedestrianSpec
from simbev_ros.scene.streets.walks import WalkGraph
from simbev_ros.world.pedestrians.crossing_sites import CrossingPlace, CrossingPlaces
from simbev_ros.world.pedestrians.plaza_visits import PlazaVisit, PlazaVisits

_CHANCE = 0.35  # that a jaywalker means to cross the street along a sidewalk
_AT_HALT = 0.5  # that somebody who would visit a plaza at once is there already
_BEYOND_M = 4.0  # of the place where it is left, so that nobody gets to the walk's end
_END_M = 0.5  # from the ends of an edge


@dataclass(frozen=True, slots=True)
class Leg:
    """A walk on SUMO's edges.

    Attributes:
        edges: All edges of the walk.
        excursion: Where it is left, to cross a street or to visit a plaza; None: it goes on for longer than the scene.
        arrival_m: SUMO's position on the last edge where it would end; None: anywhere.
        at_halt: Whether the scene begins while somebody has its halt on the plaza.
    """

    edges: tuple[str, ...]
    excursion: CrossingPlace | PlazaVisit | None = None
    arrival_m: float | None = None
    at_halt: bool = False


class WayStreams(NamedTuple):
    """What draws one pedestrian's destinations, where it crosses streets, and what it does on plazas."""

    walk: np.random.Generator
    crossings: np.random.Generator
    plazas: np.random.Generator


class Itineraries:
    """Draws the ways of people on a network."""

    def __init__(self, network: RoadNetwork, hazards: Sequence[HazardSpec] = (), plazas: Sequence[Plaza] = ()) -> None:
        """Of people on a network who keep off the hazard areas on it, and visit these plazas."""
        self._network = network
        self._walks = WalkGraph(network)
        self._places = CrossingPlaces(network, hazards)
        self._visits = PlazaVisits(network, plazas)

    def draw(self, pedestrian: PedestrianSpec, length_m: float, streams: WayStreams) -> tuple[Leg, ...]:
        """One pedestrian's way: a leg, or several with excursions between them.

        Args:
            pedestrian: Who walks.
            length_m: How far it gets during the scene at most.
            streams: Its own.
        """
        edge = self._network.lanes[pedestrian.start.lane].edge
        start_m: float | None = pedestrian.start.s_m
        legs: list[Leg] = []
        while True:
            edges = self._walks.walk(edge, max(length_m, 1.0), streams.walk)
            leg, walked_m = self._leg(pedestrian, edges, start_m, length_m, streams)
            legs.append(leg)
            if leg.excursion is None:
                return tuple(legs)
            edge, start_m = leg.excursion.far_edge, None
            length_m -= walked_m + leg.excursion.length_m

    def _leg(
        self,
        pedestrian: PedestrianSpec,
        edges: tuple[str, ...],
        start_m: float | None,
        length_m: float,
        streams: WayStreams,
    ) -> tuple[Leg, float]:
        """A leg along these edges to the first excursion, and at least how long it is.

        With ``start_m``, the distance along the first sidewalk where it begins, this may be left at once; without, the
        last excursion has just ended there.
        """
        if start_m is not None:
            excursion = self._excursion(pedestrian, edges[0], start_m - length_m, start_m + length_m, streams)
            if excursion is not None:
                beyond_m = float(np.copysign(_BEYOND_M, excursion.position_m - start_m))
                arrival_m = min(max(excursion.position_m + beyond_m, _END_M), self._places.length_m(edges[0]) - _END_M)
                at_halt = isinstance(excursion, PlazaVisit) and streams.plazas.random() < _AT_HALT
                return Leg(edges[:1], excursion, arrival_m, at_halt), 0.0
        walked_m = 0.0
        for edge in edges[1:]:
            excursion = self._excursion(pedestrian, edge, 0.0, np.inf, streams)
            if excursion is not None:
                return Leg(edges, excursion), walked_m
            walked_m += self._places.length_m(edge)
            if walked_m > length_m:
                break
        return Leg(edges), walked_m

    def _excursion(
        self, pedestrian: PedestrianSpec, edge: str, first_m: float, last_m: float, streams: WayStreams
    ) -> CrossingPlace | PlazaVisit | None:
        """What somebody leaves an edge's sidewalk for, between two distances along it."""
        visit = self._visits.visit(edge, first_m, last_m, streams.plazas) if pedestrian.visits_plazas else None
        if visit is not None or not pedestrian.jaywalks:
            return visit
        from_m, to_m = self._places.stations_m(edge)
        first_m, last_m = max(first_m, from_m), min(last_m, to_m)
        if first_m < last_m and streams.crossings.random() < _CHANCE:
            return self._places.place(edge, float(streams.crossings.uniform(first_m, last_m)))
        return None
