"""Gathers the vertices of all links of a plan in flat arrays, the input of the height computation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.maps.plan.draft import RoadClass
from simbev_ros.maps.plan.lines import stations_m
from simbev_ros.maps.plan.plan import Link, half_width_m


@dataclass(frozen=True, slots=True)
class Vertices:
    """All vertices of all links, one link after the other.

    Attributes:
        xy_m: (M, 2) map frame.
        link: (M,) index of the link.
        station_m: (M,) distance from the link's start.
        to_end_m: (M,) distance to the link's end.
        first: (L + 1,) index of each link's first vertex, and M.
        max_grade: (M,) maximum grade.
        max_bend_per_m: (M,) maximum change of grade per distance.
        half_width_m: (M,) half the width of the road.
        layer: (M,) layer of the road.
        elevated_m: (M,) minimum height of the road above the land.
    """

    xy_m: Float64Array
    link: Int64Array
    station_m: Float64Array
    to_end_m: Float64Array
    first: Int64Array
    max_grade: Float64Array
    max_bend_per_m: Float64Array
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
        """Indices of vertices that have a next vertex on the same link."""
        return np.flatnonzero(self.to_end_m > 0.0)

    @property
    def share_m(self) -> Float64Array:
        """(M,) length of road that each vertex represents."""
        step_m = np.where(np.diff(self.link) == 0, np.diff(self.station_m), 0.0)
        return np.concatenate([[0.0], step_m / 2.0]) + np.concatenate([step_m / 2.0, [0.0]])


def vertices_of(links: Sequence[Link]) -> Vertices:
    """Vertices of links with (N, 2) or (N, 3) lines."""
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
        max_grade=np.array([max_grade_of(kind) for kind in kinds])[link],
        max_bend_per_m=np.array([max_bend_of(kind) for kind in kinds])[link],
        half_width_m=np.array([half_width_m(kind) for kind in kinds])[link],
        layer=np.array([float(link.road.layer) for link in links])[link],
        elevated_m=np.array([link.road.elevated_m for link in links])[link],
    )


def max_grade_of(kind: RoadClass) -> float:
    """Maximum grade of a road class: height per distance."""
    return 0.08 if kind.speed_kmh <= 70.0 else 0.05


def max_bend_of(kind: RoadClass) -> float:
    """Maximum change of grade per distance.

    Crests and sags have a radius of at least 550 m in streets, 2 km on motorways.
    """
    return 0.0018 if kind.speed_kmh <= 60.0 else 0.001 if kind.speed_kmh <= 90.0 else 0.0005
