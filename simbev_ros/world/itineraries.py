"""Where people walk in a scene: along sidewalks and crosswalks, and jaywalkers over streets between such walks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.hazards import HazardSpec
from simbev_ros.scene.spec import PedestrianSpec
from simbev_ros.scene.walks import WalkGraph
from simbev_ros.world.crossing_places import CrossingPlace, CrossingPlaces

_CHANCE = 0.35  # that a jaywalker means to cross the street along a sidewalk
_BEYOND_M = 4.0  # of the place to cross, so that nobody gets to the walk's end


@dataclass(frozen=True, slots=True)
class Leg:
    """A walk on SUMO's edges.

    Attributes:
        edges: All edges of the walk.
        crossing: Where it is left to cross a street; None: it goes on for longer than the scene.
        arrival_m: SUMO's position on the last edge where it would end; None: anywhere.
    """

    edges: tuple[str, ...]
    crossing: CrossingPlace | None = None
    arrival_m: float | None = None


class Itineraries:
    """Draws the ways of people on a network."""

    def __init__(self, network: RoadNetwork, hazards: Sequence[HazardSpec] = ()) -> None:
        """Of people on a network who keep off the hazard areas on it."""
        self._network = network
        self._walks = WalkGraph(network)
        self._places = CrossingPlaces(network, hazards)

    def draw(
        self, pedestrian: PedestrianSpec, length_m: float, walk_rng: np.random.Generator, rng: np.random.Generator
    ) -> tuple[Leg, ...]:
        """One pedestrian's way: a leg, or several with streets to be crossed between them.

        Args:
            pedestrian: Who walks.
            length_m: How far it gets during the scene at most.
            walk_rng: Draws destinations.
            rng: Draws where streets are crossed.
        """
        edge = self._network.lanes[pedestrian.start.lane].edge
        start_m: float | None = pedestrian.start.s_m
        legs: list[Leg] = []
        while True:
            edges = self._walks.walk(edge, max(length_m, 1.0), walk_rng)
            leg, walked_m = self._leg(edges, start_m, length_m, rng) if pedestrian.jaywalks else (Leg(edges), 0.0)
            legs.append(leg)
            if leg.crossing is None:
                return tuple(legs)
            edge, start_m = leg.crossing.far_edge, None
            length_m -= walked_m

    def _leg(
        self, edges: tuple[str, ...], start_m: float | None, length_m: float, rng: np.random.Generator
    ) -> tuple[Leg, float]:
        """A leg along these edges to the first street that is crossed, and at least how long it is, across included.

        With ``start_m``, the distance along the first sidewalk where it begins, the street there may be crossed;
        without, this is the street that has just been crossed.
        """
        walked_m = 0.0
        for number, edge in enumerate(edges):
            first_m, last_m = self._places.stations_m(edge)
            if number == 0 and start_m is not None:
                first_m, last_m = max(first_m, start_m - length_m), min(last_m, start_m + length_m)
            if first_m < last_m and (number > 0 or start_m is not None) and rng.random() < _CHANCE:
                s_m = float(rng.uniform(first_m, last_m))
                place = self._places.place(edge, s_m)
                if place is not None and number == 0:
                    assert start_m is not None
                    beyond_m = float(np.copysign(_BEYOND_M, s_m - start_m))
                    return Leg((edge,), place, place.position_m + beyond_m), place.length_m
                if place is not None:
                    return Leg(edges, place), walked_m + place.length_m
            if number > 0:
                walked_m += self._places.length_m(edge)
            if walked_m > length_m:
                break
        return Leg(edges), walked_m
