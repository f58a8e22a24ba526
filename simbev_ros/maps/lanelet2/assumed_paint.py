"""Paints the lanes of files that say nothing about paint, as after MUTCD 2009, section 3B.

Lines separate lanes of one direction where vehicles may change lanes, and bound carriageways.
"""

from dataclasses import replace

from simbev_ros.maps.findings import Findings
from simbev_ros.maps.lanelet2.document import Linestring
from simbev_ros.maps.lanelet2.junctions import Junctions
from simbev_ros.maps.lanelet2.shapes import LaneletShape
from simbev_ros.maps.lanelet2.topology import Topology
from simbev_ros.maps.roads.lane_kind import LaneKind

_BETWEEN_LANES = {"type": "line_thin", "subtype": "dashed"}
_INNER_EDGE = {"type": "line_thin", "subtype": "solid", "color": "yellow"}
_OUTER_EDGE = {"type": "line_thin", "subtype": "solid"}


def with_assumed_paint(junctions: Junctions, notes: Findings) -> Junctions:
    """The junctions with paint on the lanelets outside them, if no bound of any lanelet has a type; else the same.

    Args:
        junctions: The junctions, with the relations of the lanelets.
        notes: Receives the assumption.
    """
    topology = junctions.topology
    bounds = (bound for shape in topology.shapes.values() for bound in (shape.lanelet.left, shape.lanelet.right))
    if any(bound.tags.get("type") for bound in bounds):
        return junctions
    notes.assumed("no bound of a lanelet has a type: lines between lanes are dashed, all others solid")
    shapes = {
        name: _painted(shape, topology)
        if shape.kind is LaneKind.DRIVING and name not in junctions.by_lanelet
        else shape
        for name, shape in topology.shapes.items()
    }
    return replace(junctions, topology=replace(topology, shapes=shapes))


def _painted(shape: LaneletShape, topology: Topology) -> LaneletShape:
    """A lanelet with paint on both bounds."""
    left_edge, right_edge = (_OUTER_EDGE, _INNER_EDGE) if topology.left_hand else (_INNER_EDGE, _OUTER_EDGE)
    left = _BETWEEN_LANES if shape.id in topology.left else left_edge
    right = _BETWEEN_LANES if shape.id in topology.right else right_edge
    lanelet = shape.lanelet
    return replace(
        shape, lanelet=replace(lanelet, left=_tagged(lanelet.left, left), right=_tagged(lanelet.right, right))
    )


def _tagged(line: Linestring, tags: dict[str, str]) -> Linestring:
    return replace(line, tags={**line.tags, **tags})
