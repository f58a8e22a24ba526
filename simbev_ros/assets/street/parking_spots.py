"""Finds where vehicles park in a region: along curbs with a parking lane, in the bays of lots, on the drives of houses.

The laid-out region enters, a table of spots leaves. Which of them are taken differs from scene to scene, and is drawn
by ``simulation.world.parked``.
"""

from collections.abc import Callable, Iterator, Sequence
from enum import IntEnum
from typing import NamedTuple, get_args

import numpy as np
import shapely
from scipy.ndimage import maximum_filter1d
from scipy.spatial import cKDTree

from simbev_ros.assets.land.blocks import Zones
from simbev_ros.assets.land.covers import PATH_RISE_M
from simbev_ros.assets.land.yard import Bay, Yard
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.maps.roads.lane_kind import PAVED_KINDS, LaneKind
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.surroundings import SurroundingsRecipe

STATION_M = 1.0
"""Spacing of the spots along a curb."""

SPOT_DTYPE = np.dtype(
    [
        ("x", "<f8"),  # m, map frame: on the curb, or center of a bay or drive
        ("y", "<f8"),
        ("z", "<f8"),  # m: the ground in the middle of the parking lane, bay or drive
        ("roll", "<f4"),  # rad, as in Actor.msg: the slope of the ground there
        ("pitch", "<f4"),
        ("yaw", "<f4"),  # along the lane in driving direction, or into the bay or drive
        ("length", "<f4"),  # m: room along the heading; at a curb the spacing of the spots
        ("width", "<f4"),  # m: room across it
        ("kind", "u1"),  # SpotKind
        ("use", "u1"),  # index into USES: the land around
        ("side", "i1"),  # 1: the curb is on the right of the heading, -1: on the left, 0: there is none
        ("first", "?"),  # begins a row of spots along a curb
    ]
)

USES: tuple[str, ...] = get_args(SurroundingsRecipe.model_fields["use"].annotation)
"""Names of the land uses that the column ``use`` indexes."""

_AFTER_JUNCTION_M, _BEFORE_JUNCTION_M = 9.0, 6.0
_BAY_MARGIN_M = 0.1
_KEEP_FROM_CROSSING_M, _KEEP_FROM_DRIVE_M = 5.0, 1.0
_CONTINUES_M, _CONTINUES_COSINE = 6.0, 0.9  # gap and angle to the parking lane that follows
_MIN_WIDTH_M, _MAX_WIDTH_M = 2.3, 3.4
_MAX_TURN_RAD, _BEFORE_BEND = 0.02, 8  # per station; spots in sharper bends and before them stay free for long vehicles
_MIN_ROW = 5  # spots; shorter rows have no room for a car
_CLAIMED_SHARE = 0.2  # half the width of the lane that nothing else may claim: pits of trees reach over the curb
_FOOTING_M = np.array([[1.4, 0.0], [-1.4, 0.0], [0.0, 0.75], [0.0, -0.75]])  # ahead and to the left of the center


class SpotKind(IntEnum):
    """What a vehicle parks on."""

    CURB = 0
    BAY = 1
    DRIVE = 2


class _Curb(NamedTuple):
    """Stations of one parking lane: (N, 2) on the curb, (N,) headings and widths, and the curb's side."""

    curb_m: Float64Array
    yaw_rad: Float64Array
    width_m: Float64Array
    side: int


def parking_spots(yard: Yard, zones: Zones) -> Table:
    """(K,) ``SPOT_DTYPE`` of a region in which everything else has been placed."""
    bays = [bay for bay in yard.bays if yard.ground.owns(bay.center_m[None])[0]]
    spots = np.concatenate([_bay_spots(yard.ground, bays), *(_curb_spots(yard, curb) for curb in _curbs(yard.ground))])
    for recipe, area in zones:
        spots["use"][shapely.contains_xy(area, spots["x"], spots["y"])] = USES.index(recipe.use)
    return spots


def _bay_spots(ground: RegionGround, bays: list[Bay]) -> Table:
    """Spots of the bays and drives that keep off sidewalks, at the height of their paving."""
    sidewalk = ground.streets[0].sidewalk
    shapely.prepare(sidewalk)
    bays = [bay for bay in bays if not sidewalk.intersects(_area(bay))]
    spots = np.zeros(len(bays), SPOT_DTYPE)
    center_m = np.array([bay.center_m for bay in bays]).reshape(-1, 2)
    spots["x"], spots["y"] = center_m.T
    for name in ("yaw_rad", "length_m", "width_m"):
        spots[name.split("_")[0]] = [getattr(bay, name) for bay in bays]
    spots["kind"] = [SpotKind.DRIVE if bay.is_drive else SpotKind.BAY for bay in bays]
    _set_on_ground(spots, center_m, lambda xy_m: ground.land_m(xy_m) + PATH_RISE_M)
    return spots


def _area(bay: Bay) -> shapely.Polygon:
    """Where a vehicle in a bay may stand."""
    along = np.array([np.cos(bay.yaw_rad), np.sin(bay.yaw_rad)]) * (bay.length_m / 2.0 + _BAY_MARGIN_M)
    across = left_of(along) * (bay.width_m / bay.length_m)
    return shapely.Polygon(bay.center_m + np.array([along + across, across - along, -along - across, along - across]))


def _curbs(ground: RegionGround) -> Iterator[_Curb]:
    """Rows of stations of the parking lanes beside a curb, without those near junctions and in sharp bends."""
    layout = ground.network.layout.near(ground.region.area, _CONTINUES_M)
    kinds = {strip.lane: strip.kind for strip in layout.strips}
    strips = [each for each in layout.strips_of(LaneKind.PARKING, level=0) if not each.junction]
    continues = _continuing_ends(strips)
    for strip in strips:
        is_beside_road = [kinds.get(each) in PAVED_KINDS for each in (strip.left, strip.right)]
        line = Polylines.from_lines([np.hstack([strip.left_m[:, :2], strip.right_m[:, :2]])], 4)
        length_m = float(line.length_m[0])
        s_m = np.arange(STATION_M / 2.0, length_m, STATION_M)
        if all(is_beside_road) or len(s_m) < _MIN_ROW:
            continue
        borders_m = line.values(line.parameter(np.zeros(len(s_m), np.int64), s_m)).reshape(-1, 2, 2)
        side = -1 if is_beside_road[1] else 1
        curb_m = borders_m[:, 1 if side == 1 else 0]
        width_m = np.hypot(*(borders_m[:, 0] - borders_m[:, 1]).T)
        along_m = np.gradient(curb_m, axis=0)
        yaw_rad = np.unwrap(np.arctan2(along_m[:, 1], along_m[:, 0]))
        ends_m = {0: _AFTER_JUNCTION_M, -1: _BEFORE_JUNCTION_M}
        clear_m = [0.0 if (strip.id, at) in continues else each_m for at, each_m in ends_m.items()]
        turn_rad = maximum_filter1d(np.abs(np.gradient(yaw_rad)), 2 * _BEFORE_BEND + 1)
        kept = (s_m > clear_m[0]) & (s_m < length_m - clear_m[1]) & (turn_rad < _MAX_TURN_RAD)
        kept &= (width_m >= _MIN_WIDTH_M) & (width_m <= _MAX_WIDTH_M)
        for row in _rows(kept):
            yield _Curb(curb_m[row], yaw_rad[row], width_m[row], side)


def _continuing_ends(strips: Sequence[Strip]) -> set[tuple[str, int]]:
    """Ends of parking lanes, by id and 0 (start) or -1, where another parking lane goes straight on."""
    ends = [(strip, at) for strip in strips for at in (0, -1)]
    if not ends:
        return set()
    point_m = np.array([strip.right_m[at, :2] for strip, at in ends])
    outward = np.array([_outward(strip, at) for strip, at in ends])
    first, second = cKDTree(point_m).query_pairs(_CONTINUES_M, output_type="ndarray").T
    opposite = np.sum(outward[first] * outward[second], axis=1) < -_CONTINUES_COSINE
    return {(ends[k][0].id, ends[k][1]) for k in np.unique([first[opposite], second[opposite]]).tolist()}


def _outward(strip: Strip, at: int) -> Float64Array:
    """(2,) unit direction out of a strip at its start (0) or end (-1)."""
    step_m = strip.right_m[at, :2] - strip.right_m[1 if at == 0 else -2, :2]
    return np.asarray(step_m / max(float(np.hypot(*step_m)), 1e-9))


def _curb_spots(yard: Yard, curb: _Curb) -> Table:
    """Spots along a curb where nothing stands in the way and nobody crosses."""
    inward = curb.side * left_of(np.column_stack([np.cos(curb.yaw_rad), np.sin(curb.yaw_rad)]))
    middle_m = curb.curb_m + curb.width_m[:, None] / 2.0 * inward
    blocked = shapely.dwithin(yard.ground.streets[0].crosswalk, shapely.points(middle_m), _KEEP_FROM_CROSSING_M)
    entrances = shapely.STRtree(yard.entrances)
    blocked[entrances.query(shapely.points(middle_m), predicate="dwithin", distance=_KEEP_FROM_DRIVE_M)[0]] = True
    room = shapely.buffer(shapely.points(middle_m), _CLAIMED_SHARE * curb.width_m, quad_segs=2)
    kept = ~blocked & yard.ground.owns(curb.curb_m) & [yard.claims.is_free(each) for each in room]
    rows = [_row_spots(yard.ground, curb, middle_m, row) for row in _rows(kept)]
    return np.concatenate([np.zeros(0, SPOT_DTYPE), *rows])


def _row_spots(ground: RegionGround, curb: _Curb, middle_m: Float64Array, row: slice) -> Table:
    """One row of spots."""
    spots = np.zeros(row.stop - row.start, SPOT_DTYPE)
    spots["x"], spots["y"] = curb.curb_m[row].T
    spots["yaw"], spots["width"] = curb.yaw_rad[row], curb.width_m[row]
    spots["length"], spots["kind"], spots["side"] = STATION_M, SpotKind.CURB, curb.side
    spots["first"][0] = True
    _set_on_ground(spots, middle_m[row], ground.road_m)
    return spots


def _rows(kept: BoolArray) -> Iterator[slice]:
    """Runs of kept stations that are long enough for a car."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], kept, [False]]).astype(np.int8)))
    for start, stop in edges.reshape(-1, 2).tolist():
        if stop - start >= _MIN_ROW:
            yield slice(start, stop)


def _set_on_ground(spots: Table, middle_m: Float64Array, height_m: Callable[[Float64Array], Float64Array]) -> None:
    """Fill in height and slope of the ground around (K, 2) middles."""
    ahead = np.column_stack([np.cos(spots["yaw"]), np.sin(spots["yaw"])])
    arms_m = _FOOTING_M[:, :1, None] * ahead + _FOOTING_M[:, 1:, None] * left_of(ahead)
    front_m, rear_m, left_m, right_m = height_m((middle_m + arms_m).reshape(-1, 2)).reshape(4, -1)
    spots["z"] = (front_m + rear_m) / 2.0
    spots["pitch"] = -np.arctan2(front_m - rear_m, np.ptp(_FOOTING_M[:, 0]))
    spots["roll"] = np.arctan2(left_m - right_m, np.ptp(_FOOTING_M[:, 1]))
