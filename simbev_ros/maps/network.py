"""The road network of a map: lanes with 3D center lines, junctions, signals and layout, built from a SUMO net."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.maps.findings import WALKED_VERGES, Finding, sentences_of
from simbev_ros.maps.land_features import MapFeatures
from simbev_ros.maps.roads.elevation import Elevation
from simbev_ros.maps.roads.lane_index import LineIndex
from simbev_ros.maps.roads.lane_kind import PAVED_KINDS, LaneKind
from simbev_ros.maps.roads.lane_strips import LaneStrips
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.vehicle_class import ALL_CLASSES


@dataclass(frozen=True, slots=True)
class Lane:
    """A traffic lane of the SUMO net.

    Attributes:
        id: SUMO's lane id.
        edge: SUMO's edge id; lanes of one edge run side by side in one direction.
        index: Position within its edge, 0 is the rightmost lane.
        kind: Its use.
        centerline_m: (N, 3) float64, map frame, in driving direction.
        width_m: Constant width.
        speed_mps: Speed limit.
        junction: Id of the junction that contains it (internal lanes, crossings, walking areas), else "".
        successors: Ids of the lanes that follow it (across a junction: the internal lane).
        outline_m: (M, 2) float64 outline of walking areas, because their center line does not describe them; else None.
        sumo_s_per_m: SUMO's lane position per meter along the center line. Not 1 in curves, because SUMO assigns the
            same length to all lanes of an edge.
        classes: SUMO vehicle classes that may use it.
    """

    id: str
    edge: str
    index: int
    kind: LaneKind
    centerline_m: Float64Array
    width_m: float
    speed_mps: float
    junction: str
    successors: tuple[str, ...]
    outline_m: Float64Array | None = None
    sumo_s_per_m: float = 1.0
    classes: frozenset[str] = ALL_CLASSES

    @property
    def length_m(self) -> float:
        """Length of the center line in plan view."""
        return float(np.linalg.norm(np.diff(self.centerline_m[:, :2], axis=0), axis=1).sum())


@dataclass(frozen=True, slots=True)
class Junction:
    """A junction of the SUMO net, where lanes meet.

    Attributes:
        id: SUMO's junction id.
        center_m: (3,) map frame.
        outline_m: (N, 2) float64 outline as SUMO draws it (approximate; the road surface comes from the lanes).
        signalised: Whether it has traffic lights.
    """

    id: str
    center_m: Float64Array
    outline_m: Float64Array
    signalised: bool


@dataclass(frozen=True, slots=True)
class Signal:
    """A traffic-light head.

    Attributes:
        position_m: (3,) center of the head, map frame.
        yaw_rad: Direction in which its lamps shine (towards the traffic that it stops).
        pole_m: (3,) foot of the pole that carries it, map frame.
        programme: Id of SUMO's traffic-light program.
        link: Index into the program's state string.
        lane: Id of the lane that it stops.
        opendrive_id: Id of the signal in the map's OpenDRIVE file; "" for a head placed by rule, which that file does
            not contain.
    """

    position_m: Float64Array
    yaw_rad: float
    pole_m: Float64Array
    programme: str
    link: int
    lane: str
    opendrive_id: str = ""


@dataclass(frozen=True, slots=True)
class Waypoints:
    """N positions on driving lanes.

    Attributes:
        position_m: (N, 3) map frame.
        yaw_rad: (N,) driving direction.
        lane: N lane ids.
        s_m: (N,) distance from the lane's start.
    """

    position_m: Float64Array
    yaw_rad: Float64Array
    lane: tuple[str, ...]
    s_m: Float64Array


@dataclass(frozen=True)
class RoadNetwork:
    """The road network of a map.

    Attributes:
        name: The map's name.
        lanes: Lanes by id.
        junctions: Junctions by id.
        signals: Traffic-light heads in the row order of /world/signals.
        datum: Position of the map frame on Earth.
        net_path: The SUMO net that it was built from.
        opendrive_path: OpenDRIVE file of the same roads.
        layout: Ground geometry of the lanes, with borders, levels and paint.
        features: The land around the roads.
        seed: Random seed for everything that the map does not prescribe.
        findings: What was left out, repaired or assumed.
        origin_m: Coordinates of the map frame's origin in the map's file.
    """

    name: str
    lanes: Mapping[str, Lane]
    junctions: Mapping[str, Junction]
    signals: tuple[Signal, ...]
    datum: MapDatum
    net_path: Path
    opendrive_path: Path
    layout: Layout
    features: MapFeatures
    seed: int
    findings: tuple[Finding, ...] = ()
    origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def notes(self) -> tuple[str, ...]:
        """One sentence for each kind of finding, for the user."""
        return sentences_of(self.name, self.findings)

    @cached_property
    def elevation(self) -> Elevation:
        """Heights of the road surface at any position."""
        return Elevation(self.layout)

    @cached_property
    def lane_strips(self) -> LaneStrips:
        """Ground geometry of the driving lanes, searchable by position."""
        return LaneStrips(self.layout)

    @property
    def opendrive(self) -> str:
        """OpenDRIVE text of the same roads, read from the file; its heights begin at the datum's altitude."""
        text = self.opendrive_path.read_text(encoding="utf-8")
        head, end, rest = text.partition("</header>")
        if not end or not self.datum.altitude_m or "<offset" in head:
            return text
        return f'{head}    <offset x="0" y="0" z="{self.datum.altitude_m!r}" hdg="0"/>\n    {end}{rest}'

    def has_opendrive(self, recorded: bytes) -> bool:
        """Whether a recorded OpenDRIVE text has these roads; earlier versions left the datum's altitude out."""
        file = self.opendrive_path.read_bytes()
        return recorded in (file, self.opendrive.encode())

    @cached_property
    def max_speed_mps(self) -> float:
        """The highest speed limit of any lane."""
        return max(lane.speed_mps for lane in self.lanes.values())

    def lanes_of_edge(self, edge: str) -> tuple[Lane, ...]:
        """The lanes of an edge."""
        return self._lanes_by_edge.get(edge, ())

    @cached_property
    def _lanes_by_edge(self) -> Mapping[str, tuple[Lane, ...]]:
        lanes: dict[str, tuple[Lane, ...]] = {}
        for lane in self.lanes.values():
            lanes[lane.edge] = (*lanes.get(lane.edge, ()), lane)
        return lanes

    def lanes_of(self, *kinds: LaneKind) -> tuple[Lane, ...]:
        """The lanes of these kinds, including those inside junctions, in the network's order."""
        return tuple(lane for lane in self.lanes.values() if lane.kind in kinds)

    @cached_property
    def verges(self) -> BaseGeometry:
        """The area on which people walk beside roads without sidewalks; the layout has no strips there."""
        if all(finding.rule != WALKED_VERGES for finding in self.findings):
            return shapely.Polygon()
        paved = {strip.lane for strip in self.layout.strips}
        unpaved = [lane for lane in self.lanes_of(LaneKind.SIDEWALK, LaneKind.WALKING_AREA) if lane.id not in paved]
        walks = [lane for lane in unpaved if lane.kind is LaneKind.SIDEWALK and not lane.junction]
        lines = np.array([shapely.LineString(lane.centerline_m[:, :2]) for lane in walks], object)
        corners = [lane.outline_m for lane in unpaved if lane.outline_m is not None]
        beside = shapely.buffer(lines, [lane.width_m / 2.0 for lane in walks], cap_style="flat")
        return overlay.union_all([*beside, *(shapely.make_valid(shapely.Polygon(corner)) for corner in corners)])

    def waypoints(self, spacing_m: float) -> Waypoints:
        """Waypoints on driving lanes outside junctions: the first at half the spacing, then one every ``spacing_m``."""
        lanes = [lane for lane in self.lanes_of(LaneKind.DRIVING) if not lane.junction]
        lines = Polylines.from_lines([lane.centerline_m for lane in lanes])
        count = np.maximum(np.ceil(lines.length_m / spacing_m - 0.5).astype(np.int64), 0)
        row, number = ragged_indices(count)
        return self._waypoints(lanes, lines, row, spacing_m * (number.astype(np.float64) + 0.5))

    def nearest_lane(self, points_m: Float64Array, yaw_rad: Float64Array | None = None) -> Waypoints:
        """The nearest position on a driving lane, including lanes inside junctions, for each of N points.

        Args:
            points_m: (N, 2) or (N, 3) float64, map frame; if a height is given, lanes on its level are preferred.
            yaw_rad: (N,) directions of travel; lanes in this direction are preferred.
        """
        nearest = self._lane_index.nearest(points_m, yaw_rad)
        return self._waypoints(self.lanes_of(LaneKind.DRIVING), self._lane_index.lines, nearest.row, nearest.s_m)

    @cached_property
    def _lane_index(self) -> LineIndex:
        return LineIndex(Polylines.from_lines([lane.centerline_m for lane in self.lanes_of(LaneKind.DRIVING)]))

    @staticmethod
    def _waypoints(lanes: Sequence[Lane], lines: Polylines, row: Int64Array, s_m: Float64Array) -> Waypoints:
        """Waypoints at distances ``s_m`` along the center lines ``row`` of the lanes."""
        parameter = lines.parameter(row, s_m)
        heading = lines.headings(parameter)
        yaw_rad = np.arctan2(heading[:, 1], heading[:, 0])
        return Waypoints(lines.values(parameter), yaw_rad, tuple(lanes[each].id for each in row.tolist()), s_m)

    def pose_on_lane(self, lane_id: str, s_m: float) -> tuple[Float64Array, float]:
        """(3,) position in the map frame and yaw in radians at distance ``s_m`` along a lane (clipped to its ends)."""
        line = self.lanes[lane_id].centerline_m
        steps = np.diff(line, axis=0)
        lengths = np.linalg.norm(steps[:, :2], axis=1)
        stations = np.concatenate([[0.0], np.cumsum(lengths)])
        s_m = min(max(s_m, 0.0), float(stations[-1]))
        index = int(np.clip(np.searchsorted(stations, s_m, side="right") - 1, 0, len(steps) - 1))
        fraction = (s_m - stations[index]) / lengths[index] if lengths[index] > 0 else 0.0
        return line[index] + fraction * steps[index], float(np.arctan2(steps[index, 1], steps[index, 0]))


def paths_beyond(lane: Lane, lanes: Mapping[str, Lane]) -> Iterator[tuple[str, ...]]:
    """Yield the paths of vehicles from a lane to the lanes outside junctions that follow.

    Args:
        lane: A lane of the carriageway.
        lanes: All lanes by id.

    Yields:
        Ids of the lanes inside the junction in driving order, and of the lane beyond. Lanes for pedestrians, which form
        rings around junctions, are not followed.
    """
    pending: list[tuple[str, ...]] = [(following,) for following in reversed(lane.successors)]
    while pending:
        path = pending.pop()
        last = lanes[path[-1]]
        if last.kind not in PAVED_KINDS:
            continue
        if last.junction:
            pending += [(*path, following) for following in reversed(last.successors) if following not in path]
        else:
            yield path
