"""Groups overlapping lanelets into junctions: Lanelet2 has no junctions of its own."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from simbev_ros.maps.lane_graph.joined_names import JoinedNames
from simbev_ros.maps.lanelet2.topology import Topology

_AREA = "intersection_area"
"""Autoware's tag of lanelets inside an intersection: the id of its outline."""
_MAX_STEPS = 12
_MAX_INSIDE = 200


@dataclass(frozen=True)
class Junctions:
    """The junctions of a map.

    Attributes:
        topology: Relations of the lanelets.
        by_lanelet: Lanelet inside a junction → id of the junction.
    """

    topology: Topology
    by_lanelet: Mapping[str, str]

    @cached_property
    def entries(self) -> Mapping[str, tuple[str, ...]]:
        """Lanelet inside a junction → lanelets outside from which it is reached."""
        return {name: tuple(self._outside(name)) for name in self.by_lanelet}

    def approaches(self, name: str) -> tuple[str, ...]:
        """The lanelets where traffic waits for a rule of a lanelet: itself, or those before its junction, if any."""
        return self.entries.get(name) or (name,)

    def paths(self, name: str) -> dict[str, tuple[str, ...]]:
        """Lanelets where traffic from a lanelet leaves junctions → those passed inside, in order.

        These are outside junctions, or the last ones inside at the edge of the map; a lanelet inside is passed itself.
        """
        found: dict[str, tuple[str, ...]] = {}
        through: dict[str, tuple[str, ...]] = {name: (name,) if name in self.by_lanelet else ()}
        pending = [name]
        for each in pending:
            if each in self.by_lanelet and not self.topology.following[each]:
                found.setdefault(each, through[each])
            for after in self.topology.following[each]:
                if after not in self.by_lanelet:
                    found.setdefault(after, through[each])
                elif after not in through and len(through[each]) < _MAX_STEPS and len(through) < _MAX_INSIDE:
                    through[after] = (*through[each], after)
                    pending.append(after)
        return found

    def _outside(self, name: str) -> dict[str, None]:
        """The lanelets outside junctions that lead to a lanelet inside one."""
        seen, pending, found = {name}, [name], dict[str, None]()
        for each in pending:
            for before in self.topology.preceding[each]:
                if before not in self.by_lanelet:
                    found[before] = None
                elif before not in seen and len(seen) <= _MAX_INSIDE:
                    seen.add(before)
                    pending.append(before)
        return found


def junctions_of(topology: Topology) -> Junctions:
    """Junctions: connected groups of carriageways of which a lanelet overlaps another or lies in an intersection."""
    shapes = topology.shapes
    inside = [
        names
        for names in topology.carriageways
        if any(topology.conflicts[name] or _AREA in shapes[name].lanelet.tags for name in names)
    ]
    members = {name for names in inside for name in names}
    joined = JoinedNames()
    for names in inside:
        for name in names:
            joined.join(names[0], name)
            for other in (*topology.conflicts[name], *topology.following[name]):
                if other in members:
                    joined.join(name, other)
            if _AREA in shapes[name].lanelet.tags:
                joined.join(name, f"~{shapes[name].lanelet.tags[_AREA]}")
    return Junctions(topology, {name: f"J{joined.resolve(name).lstrip('~')}" for names in inside for name in names})
