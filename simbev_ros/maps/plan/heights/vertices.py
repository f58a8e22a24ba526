"""Vertices of all links of a plan in one array, for the search for their heights."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.maps.plan.draft import RoadClass
from simbev_ros.maps.plan.lines import stations_m
from simbev_ros.maps.plan.plan import Link, half_width_m
from simbev_ros.types import Float64Array, Int64Array


@dataclass(frozen=True, slots=True)
class Vertices:
    """All vertices of all links, one link after the other.

    Attributes:
        xy_m: (M, 2).
        link: (M,) index of the link.
        station_m: (M,) distance from the link's start.
        to_end_m: (M,) distance to the link's end.
        first: (L + 1,) index of each link's first vertex, and M.
        steepest: (M,) largest grade allowed.
        bend_per_m: (M,) largest change of grade by distance allowed.
        half_width_m: (M,) of the road.
        layer: (M,) of the road.
        elevated_m: (M,) of the road.
    """

    xy_m: Float64Array
    link: Int64Array
    station_m: Float64Array
    to_end_m: Float64Array
    first: Int64Array
    steepest: Float64Array
    bend_per_m: Float64Array
    half_width_m: Float64Array
    layer: Float64Array
    elevated_m: Float64Array

    def __len__(self) -> int:
        return len(self.xy_m)

    @property
    def inner(self) -> Int64Array:
        """Indices of vertices that are not at an end of their link."""
        return np.flatnonzero((self.station_m > 0.0) & (self.to_end_m > 0.0))

    @property
    def with_next(self) -> Int64Array:
        """Indices of vertices that the next one follows on the same link."""
        return np.flatnonzero(self.to_end_m > 0.0)

    @property
    def share_m(self) -> Float64Array:
        """(M,) length of road that each vertex stands for."""
        step_m = np.where(np.diff(self.link) == 0, np.diff(self.station_m), 0.0)
        shares: Float64Array = np.concatenate([[0.0], step_m / 2.0]) + np.concatenate([step_m / 2.0, [0.0]])
        return shares


def vertices_of(links: Sequence[Link]) -> Vertices:
    """The vertices of links, whose lines are (N, 2) or (N, 3)."""
    counts = [len(link.line_m) for link in links]
    stations = [stations_m(link.line_m) for link in links]
    kinds = [link.road.kind for link in links]
    link = np.repeat(np.arange(len(links)), counts)
    return Vertices(
        xy_m=np.concatenate([link.line_m[:, :2] for link in links]),
        link=link,
        station_m=np.concatenate(stations),
        to_end_m=np.concatenate([along_m[-1] - along_m for along_m in stations]),
        first=np.concatenate([[0], np.cumsum(counts)]),
        steepest=np.array([largest_grade(kind) for kind in kinds])[link],
        bend_per_m=np.array([largest_bend_per_m(kind) for kind in kinds])[link],
        half_width_m=np.array([half_width_m(kind) for kind in kinds])[link],
        layer=np.array([float(link.road.layer) for link in links])[link],
        elevated_m=np.array([link.road.elevated_m for link in links])[link],
    )


def largest_grade(kind: RoadClass) -> float:
    """Height by distance, at most."""
    return 0.08 if kind.speed_kmh <= 70.0 else 0.05


def largest_bend_per_m(kind: RoadClass) -> float:
    """Change of grade by distance, at most: crests and sags of 550 m radius in streets, 2 km on motorways."""
    return 0.0018 if kind.speed_kmh <= 60.0 else 0.001 if kind.speed_kmh <= 90.0 else 0.0005
