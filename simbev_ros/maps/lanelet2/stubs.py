"""Short edges where lanelets inside a junction begin or end at the edge of the map: traffic waits there, or leaves."""

from functools import cached_property

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.lane_graph.traffic import TrafficEdge, TrafficLane
from simbev_ros.maps.lanelet2.junctions import Junctions
from simbev_ros.maps.lanelet2.shapes import resampled_m, stations_m
from simbev_ros.maps.lanelet2.tags import allowed_classes, speed_limit_mps
from simbev_ros.maps.roads.lane_kind import LaneKind

_LENGTH_M = 3.0
_MAX_FRACTION = 0.25


class Stubs:
    """The edges at both ends of such lanelets; those that begin or end at the same points share one."""

    def __init__(self, junctions: Junctions) -> None:
        self._junctions = junctions

    @cached_property
    def entries(self) -> dict[str, str]:
        """Lanelet inside a junction that nothing leads to → id of the edge at its start."""
        return self._at_edge("in")

    @cached_property
    def exits(self) -> dict[str, str]:
        """Lanelet inside a junction that leads nowhere → id of the edge at its end."""
        return self._at_edge("out")

    def _at_edge(self, end: str) -> dict[str, str]:
        topology, first = self._junctions.topology, dict[tuple[int, int], str]()
        beyond = topology.preceding if end == "in" else topology.following
        found = {}
        for name in self._junctions.by_lanelet:
            shape = topology.shapes[name]
            if shape.kind is LaneKind.DRIVING and not beyond[name]:
                found[name] = f"{first.setdefault(shape.start if end == 'in' else shape.end, name)}.{end}"
        return found

    def edges(self) -> list[TrafficEdge]:
        """All these edges."""
        return [self._edge(*item) for stubs in (self.entries, self.exits) for item in _groups(stubs).items()]

    def inside_m(self, name: str) -> Float64Array:
        """(N, 3) part of a lanelet's center line without these edges."""
        line_m = self._junctions.topology.shapes[name].center_m
        share = _share(line_m)
        low, high = share * (name in self.entries), 1.0 - share * (name in self.exits)
        return line_m if high - low == 1.0 else _part_m(line_m, low, high)

    def _edge(self, edge: str, names: list[str]) -> TrafficEdge:
        """An edge; it stands for the lanelets that begin there."""
        topology, begins = self._junctions.topology, edge.endswith(".in")
        shape = topology.shapes[names[0]]
        share = _share(shape.center_m)
        span = (0.0, share) if begins else (1.0 - share, 1.0)
        node, junction = f"P{edge}", self._junctions.by_lanelet[names[0]]
        keys = tuple(topology.shapes[name].key for name in names) if begins else ()
        lane = TrafficLane(
            keys,
            shape.kind,
            _part_m(shape.center_m, *span),
            shape.width_m,
            speed_limit_mps(shape.lanelet.tags),
            allowed_classes(shape.lanelet.tags, shape.kind),
        )
        inner_m = shape.right_m if topology.left_hand else shape.left_m
        start, end = (node, junction) if begins else (junction, node)
        return TrafficEdge(edge, edge, start, end, (lane,), _part_m(inner_m, *span))


def _groups(stubs: dict[str, str]) -> dict[str, list[str]]:
    """Edge → its lanelets."""
    found: dict[str, list[str]] = {}
    for name, edge in stubs.items():
        found.setdefault(edge, []).append(name)
    return found


def _share(line_m: Float64Array) -> float:
    """Share of a line that becomes an edge."""
    return float(min(_LENGTH_M / max(stations_m(line_m)[-1], _LENGTH_M), _MAX_FRACTION))


def _part_m(line_m: Float64Array, low: float, high: float) -> Float64Array:
    """(N, 3) part of a line between two fractions of its length."""
    fractions = stations_m(line_m) / stations_m(line_m)[-1]
    inner = fractions[(fractions > low) & (fractions < high)]
    return resampled_m(line_m, np.array([low, *inner, high]))
