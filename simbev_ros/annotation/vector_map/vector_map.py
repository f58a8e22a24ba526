"""The roads around the ego as vectors: what map learning (MapTR, VectorMapNet, OpenLane-V2) is trained on.

A record is made of plain values, for JSON::

    patch           length_m, width_m: a rectangle that turns with the ego's heading and does not tilt
    map_from_patch  translation [x, y, z] m, yaw rad: of the patch frame (x ahead, y left, z up)
    lanes           stretches of lanes of which paint and level stay the same, in the layout's order
        id, lane, road        of the stretch, of its lane, and of its road
        type                  driving, bicycle, parking, shoulder or sidewalk
        speed_mps, width_m    speed limit, and mean width
        level                 0 on the ground, k on a structure above k layers
        junction              id of the junction that it is inside of, or null
        center, left, right   pieces, each in driving direction (of sidewalks: as the road runs)
        left_line, right_line {paint, color, width_m}: paint as OpenDRIVE names it, from the lane's inside outward
        successors, predecessors, left_neighbors, right_neighbors
                              ids of stretches, in or out of the patch; neighbours may be oncoming, and several where
                              the lane beside is divided elsewhere
    lines           painted lines along lanes, each once, where the paint is, clear of crosswalks
        class                 lane: parts lanes of one direction; center: parts directions; edge: bounds the road
        paint, color, width_m paint from left to right of the line
        level, pieces
    edges           where the paved ground ends: curbs, islands, bare edges; what is paved lies to the left
        id, level, pieces
    crosswalks      id, level, outlines: rings without their first point repeated
    stop_lines      id, level, yields, lanes (ids of those whose traffic halts there), pieces
    traffic_lights  those for a lane of the record: id (that of /world/signals), position, yaw of the lamps, lanes
    signs           those for a lane of the record: id, kind, speed_mps of limits, position of the foot, yaw, lanes

``pieces``, ``center``, ``left``, ``right`` are lists of polylines, as a line may leave the patch and come back; a
polyline is a list of points [x, y, z], metres, patch frame, to the millimetre. Everything is clipped by the patch
exactly, and to the next metre by what is on the ego's level: what passes above or beneath is left out.

The classes of MapTR are: dividers, ``lines`` of class lane and center; boundaries, ``edges``; crossings,
``crosswalks``; centre lines, ``center`` of ``lanes`` of type driving. Ids of lanes, roads, junctions and signs are the
map's; those of edges, crosswalks and stop lines hold within a scene.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.annotation.bev.levels import EgoLevel
from simbev_ros.annotation.vector_map.patch import Holds, Patch, PatchLines, plain_points
from simbev_ros.annotation.vector_map.traffic_guides import TrafficGuides
from simbev_ros.maps.lane_links import StripLinks, halting_strips, strip_links
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.lane_strips import LaneStrips
from simbev_ros.maps.roads.layout import Crosswalk, Layout, Line, Strip
from simbev_ros.maps.roads.line_paths import LinePath, line_paths
from simbev_ros.maps.roads.road_edges import road_edges
from simbev_ros.scene.state import WorldState

LENGTH_M, WIDTH_M = 60.0, 30.0
"""The patch of MapTR."""

_KINDS = (LaneKind.DRIVING, LaneKind.BICYCLE, LaneKind.PARKING, LaneKind.SHOULDER, LaneKind.SIDEWALK)
_SIDES = ("center", "left", "right")
_Record = dict[str, Any]


class VectorMap:
    """The roads of a scene, prepared once."""

    def __init__(
        self, network: RoadNetwork, layout: Layout, length_m: float = LENGTH_M, width_m: float = WIDTH_M
    ) -> None:
        """Prepare.

        Args:
            network: Whose traffic lights are meant.
            layout: Of its roads those around the scene (``Layout.near``), as far as patches reach and 20 m more.
            length_m: Of the patch, half of it ahead of the ego.
            width_m: Of the patch.
        """
        self._size_m = length_m, width_m
        strips = [strip for strip in layout.strips_of(*_KINDS) if strip.outline_m is None]
        driven = LaneStrips(layout)
        self._lanes = _Lanes(strips)
        paths = [path for level in layout.levels for path in line_paths(layout, level)]
        self._lines = _Layer([_line_facts(path) for path in paths], PatchLines([path.along_m for path in paths]))
        edges = list(road_edges(layout))
        self._edges = _Layer(
            [{"id": number, "level": edge.level} for number, edge in enumerate(edges)],
            PatchLines([edge.along_m for edge in edges], real=[edge.real for edge in edges]),
        )
        stop_lines = layout.stop_lines
        self._stop_lines = _Layer(
            [
                {"id": number, "level": line.level, "yields": line.yields, "lanes": list(halting)}
                for number, (line, halting) in enumerate(
                    zip(stop_lines, halting_strips(stop_lines, driven), strict=True)
                )
            ],
            PatchLines([line.ends_m for line in stop_lines]),
        )
        self._crosswalks = _Crosswalks(layout.crosswalks)
        self._guides = TrafficGuides(network, layout, driven)

    def record(self, state: WorldState, ego_level: EgoLevel | None = None) -> _Record:
        """What is around the ego, as this module's docstring says.

        Args:
            state: The world now.
            ego_level: The level that the ego is on; None: everything counts.
        """
        patch = Patch.around_ego(state, *self._size_m)
        holds = None if ego_level is None else ego_level.members.holds
        lanes = self._lanes.within(patch, holds)
        return {
            "patch": {"length_m": patch.length_m, "width_m": patch.width_m},
            "map_from_patch": {"translation": patch.origin_m.tolist(), "yaw": patch.yaw_rad},
            "lanes": lanes,
            "lines": self._lines.within(patch, holds),
            "edges": self._edges.within(patch, holds),
            "crosswalks": self._crosswalks.within(patch, holds),
            "stop_lines": self._stop_lines.within(patch, holds),
            **self._guides.of([lane["id"] for lane in lanes], patch),
        }


class _Layer:
    """Things that are one line each, and what is known of them besides."""

    def __init__(self, facts: Sequence[_Record], lines: PatchLines) -> None:
        self._facts, self._lines = facts, lines

    def within(self, patch: Patch, holds: Holds | None) -> list[_Record]:
        """Records of those in a patch, in order."""
        found = self._lines.within(patch, holds)
        return [{**self._facts[row], "pieces": [plain_points(piece) for piece in found[row]]} for row in found]


class _Lanes:
    """Stretches of lanes, three lines each."""

    def __init__(self, strips: Sequence[Strip]) -> None:
        self._facts = [_lane_facts(strip, links) for strip, links in zip(strips, strip_links(strips), strict=True)]
        self._lines = PatchLines(
            [side_m for strip in strips for side_m in (strip.center_m, strip.left_m, strip.right_m)],
            guides_m=[strip.center_m for strip in strips for _ in _SIDES],  # sides end where the middle leaves a level
        )

    def within(self, patch: Patch, holds: Holds | None) -> list[_Record]:
        """Records of those in a patch, in order."""
        found = self._lines.within(patch, holds)
        return [
            {
                **self._facts[row],
                **{
                    side: [plain_points(piece) for piece in found.get(len(_SIDES) * row + place, ())]
                    for place, side in enumerate(_SIDES)
                },
            }
            for row in sorted({line // len(_SIDES) for line in found})
        ]


class _Crosswalks:
    """Crosswalks, which are areas."""

    def __init__(self, crosswalks: Sequence[Crosswalk]) -> None:
        self._levels = [crosswalk.level for crosswalk in crosswalks]
        self._outlines_m = [crosswalk.outline_m for crosswalk in crosswalks]
        self._center_m = np.array([outline_m.mean(axis=0) for outline_m in self._outlines_m]).reshape(-1, 3)
        self._radius_m = np.array(
            [
                np.linalg.norm(outline_m - center_m, axis=1).max()
                for outline_m, center_m in zip(self._outlines_m, self._center_m, strict=True)
            ]
        )

    def within(self, patch: Patch, holds: Holds | None) -> list[_Record]:
        """Records of those in a patch, in order; on a level is what has its middle there."""
        reach_m = float(np.linalg.norm(patch.half_m)) + self._radius_m
        gap_m = np.linalg.norm(self._center_m[:, :2] - patch.origin_m[:2], axis=1)
        near = np.flatnonzero(gap_m <= reach_m)
        if holds is not None and len(near):
            near = near[holds(self._center_m[near])]
        window = shapely.box(*-patch.half_m, *patch.half_m)
        records = []
        for row in near.tolist():
            area = shapely.make_valid(shapely.Polygon(patch.from_map(self._outlines_m[row])))
            parts = _polygons(shapely.intersection(area, window))
            if parts:
                outlines = [plain_points(shapely.get_coordinates(part.exterior, include_z=True)[:-1]) for part in parts]
                records.append({"id": row, "level": self._levels[row], "outlines": outlines})
        return records


def _polygons(area: BaseGeometry) -> list[shapely.Polygon]:
    """The polygons of an area; make_valid may nest them, and leave lines."""
    parts = shapely.get_parts(shapely.get_parts(area))
    return [part for part in parts if isinstance(part, shapely.Polygon) and not part.is_empty]


def _lane_facts(strip: Strip, links: StripLinks) -> _Record:
    """What is known of a stretch besides its lines."""
    return {
        "id": strip.id,
        "lane": strip.lane,
        "road": strip.road,
        "type": strip.kind.value,
        "speed_mps": round(strip.speed_mps, 3),
        "width_m": round(float(np.linalg.norm((strip.left_m - strip.right_m)[:, :2], axis=1).mean()), 3),
        "level": strip.level,
        "junction": strip.junction or None,
        "left_line": _line(strip.left_line),
        "right_line": _line(strip.right_line),
        "successors": list(links.successors),
        "predecessors": list(links.predecessors),
        "left_neighbors": list(links.left),
        "right_neighbors": list(links.right),
    }


def _line(line: Line) -> _Record:
    """Paint on a border."""
    return {"paint": line.paint.value, "color": line.color.value, "width_m": line.width_m}


def _line_facts(path: LinePath) -> _Record:
    """What is known of a painted line besides where it runs."""
    return {
        "class": path.kind.value,
        "paint": path.paint.value,
        "color": path.color.value,
        "width_m": path.width_m,
        "level": path.level,
    }
