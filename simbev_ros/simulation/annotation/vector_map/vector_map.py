"""Vector map labels: the roads around the ego as polylines, as used to train MapTR, VectorMapNet or OpenLane-V2.

A ``WorldState`` enters ``VectorMap.record``; a record of plain values for JSON leaves::

    patch           length_m, width_m: a horizontal rectangle that turns with the ego's heading
    map_from_patch  translation [x, y, z] m, yaw rad: of the patch frame (x ahead, y left, z up)
    lanes           lane sections of constant markings and level, in the layout's order
        id, lane, road        ids of the section, of its lane, and of its road
        type                  driving, bicycle, parking, shoulder or sidewalk
        speed_mps, width_m    speed limit, and mean width
        level                 0 on the ground, k on a structure above k layers
        junction              id of the junction that contains it, or null
        center, left, right   pieces, each in driving direction (sidewalks: in the road's direction)
        left_line, right_line {paint, color, width_m}: OpenDRIVE marking type, from the lane's inside outward
        successors, predecessors, left_neighbors, right_neighbors
                              ids of sections, in or out of the patch; neighbors may be oncoming, and several if the
                              adjacent lane is divided elsewhere
    lines           painted lines along lanes, each once, where they are painted, without crosswalks
        class                 lane: between lanes of one direction; center: between directions; edge: road border
        paint, color, width_m marking type from left to right of the line
        level, pieces
    edges           borders of paved ground: curbs, islands, bare edges; the pavement is on the left
        id, level, pieces
    crosswalks      id, level, outlines: rings without the first point repeated at the end
    stop_lines      id, level, yields, lanes (ids of those whose traffic stops there), pieces
    traffic_lights  lights that apply to a lane of the record: id (as in /world/signals), position, yaw of the lamps,
        lanes
    signs           signs that apply to a lane of the record: id, kind, speed_mps of limits, position of the foot, yaw,
        lanes

``pieces``, ``center``, ``left``, ``right`` are lists of polylines, as a line may leave the patch and come back; a
polyline is a list of points [x, y, z] in meters, patch frame, rounded to the millimeter. Everything is clipped exactly
to the patch, and to within a meter to the ego's level: roads that pass above or below are left out.

The classes of MapTR are: dividers = ``lines`` of class lane and center; boundaries = ``edges``; crossings =
``crosswalks``; center lines = ``center`` of ``lanes`` of type driving. Ids of lanes, roads, junctions and signs are
those of the map; ids of edges, crosswalks and stop lines are unique within a scene.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import polygon_parts
from simbev_ros.maps.lane_links import StripLinks, halting_strips, strip_links
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.lane_strips import LaneStrips
from simbev_ros.maps.roads.layout import Crosswalk, Layout, Line, Strip
from simbev_ros.maps.roads.line_paths import LinePath, line_paths
from simbev_ros.maps.roads.road_edges import road_edges
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.annotation.bev.levels import EgoLevel
from simbev_ros.simulation.annotation.vector_map.patch import LevelFilter, Patch, PatchLines, plain_points
from simbev_ros.simulation.annotation.vector_map.traffic_guides import TrafficGuides

LENGTH_M, WIDTH_M = 60.0, 30.0
"""Default patch size, that of MapTR."""

_KINDS = (LaneKind.DRIVING, LaneKind.BICYCLE, LaneKind.PARKING, LaneKind.SHOULDER, LaneKind.SIDEWALK)
_SIDES = ("center", "left", "right")
_Record = dict[str, Any]


class VectorMap:
    """Produces vector map records of a scene, from layers that are prepared once."""

    def __init__(
        self, network: RoadNetwork, layout: Layout, length_m: float = LENGTH_M, width_m: float = WIDTH_M
    ) -> None:
        """Prepare the layers.

        Args:
            network: Road network, for its traffic lights.
            layout: Roads around the scene (``Layout.near``), up to 20 m beyond where patches reach.
            length_m: Length of the patch, half of it ahead of the ego.
            width_m: Width of the patch.
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
        """Vector map around the ego, in the format of this module's docstring.

        Args:
            state: The world state to label.
            ego_level: The road level that the ego is on; None: everything counts.
        """
        patch = Patch.around_ego(state, *self._size_m)
        level_filter = None if ego_level is None else ego_level.members.holds
        lanes = self._lanes.within(patch, level_filter)
        return {
            "patch": {"length_m": patch.length_m, "width_m": patch.width_m},
            "map_from_patch": {"translation": patch.origin_m.tolist(), "yaw": patch.yaw_rad},
            "lanes": lanes,
            "lines": self._lines.within(patch, level_filter),
            "edges": self._edges.within(patch, level_filter),
            "crosswalks": self._crosswalks.within(patch, level_filter),
            "stop_lines": self._stop_lines.within(patch, level_filter),
            **self._guides.records([lane["id"] for lane in lanes], patch),
        }


class _Layer:
    """Elements with one line each, and their attributes."""

    def __init__(self, facts: Sequence[_Record], lines: PatchLines) -> None:
        self._facts, self._lines = facts, lines

    def within(self, patch: Patch, level_filter: LevelFilter | None) -> list[_Record]:
        """Records of the elements in a patch, in order."""
        pieces_of = self._lines.within(patch, level_filter)
        return [{**self._facts[row], "pieces": [plain_points(piece) for piece in pieces_of[row]]} for row in pieces_of]


class _Lanes:
    """Lane sections, with three lines each."""

    def __init__(self, strips: Sequence[Strip]) -> None:
        self._facts = [_lane_facts(strip, links) for strip, links in zip(strips, strip_links(strips), strict=True)]
        self._lines = PatchLines(
            [side_m for strip in strips for side_m in (strip.center_m, strip.left_m, strip.right_m)],
            # sides end where the center line leaves a level
            guides_m=[strip.center_m for strip in strips for _ in _SIDES],
        )

    def within(self, patch: Patch, level_filter: LevelFilter | None) -> list[_Record]:
        """Records of the sections in a patch, in order."""
        pieces_of = self._lines.within(patch, level_filter)
        return [
            {
                **self._facts[row],
                **{
                    side: [plain_points(piece) for piece in pieces_of.get(len(_SIDES) * row + index, ())]
                    for index, side in enumerate(_SIDES)
                },
            }
            for row in sorted({line // len(_SIDES) for line in pieces_of})
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

    def within(self, patch: Patch, level_filter: LevelFilter | None) -> list[_Record]:
        """Records of the crosswalks in a patch, in order; a crosswalk's center decides which level it is on."""
        reach_m = float(np.linalg.norm(patch.half_m)) + self._radius_m
        distance_m = np.linalg.norm(self._center_m[:, :2] - patch.origin_m[:2], axis=1)
        near = np.flatnonzero(distance_m <= reach_m)
        if level_filter is not None and len(near):
            near = near[level_filter(self._center_m[near])]
        window = shapely.box(*-patch.half_m, *patch.half_m)
        records = []
        for row in near.tolist():
            area = shapely.make_valid(shapely.Polygon(patch.from_map(self._outlines_m[row])))
            parts = _polygons(overlay.intersection(area, window))
            if parts:
                outlines = [plain_points(shapely.get_coordinates(part.exterior, include_z=True)[:-1]) for part in parts]
                records.append({"id": row, "level": self._levels[row], "outlines": outlines})
        return records


def _polygons(area: BaseGeometry) -> list[shapely.Polygon]:
    """The polygons of an area that are not empty."""
    return [part for part in polygon_parts(area) if not part.is_empty]


def _lane_facts(strip: Strip, links: StripLinks) -> _Record:
    """Attributes of a lane section, without its lines."""
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
    """Marking on the border of a lane."""
    return {"paint": line.paint.value, "color": line.color.value, "width_m": line.width_m}


def _line_facts(path: LinePath) -> _Record:
    """Attributes of a painted line, without its geometry."""
    return {
        "class": path.kind.value,
        "paint": path.paint.value,
        "color": path.color.value,
        "width_m": path.width_m,
        "level": path.level,
    }
