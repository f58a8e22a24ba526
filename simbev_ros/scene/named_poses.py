"""Poses on a map that have names: where vehicles and people can start, junctions and crosswalks."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.scene.streets.lane_positions import positions_along

_SPACING_M, _HEADROOM_M = 20.0, 4.5
_MARGIN_M = 1000.0  # around the lanes


class NamedPose(NamedTuple):
    """A pose, and how much room there is around it.

    Attributes:
        name: Unique on its map.
        description: For people.
        tags: What it is for.
        position_m: (3,) map frame.
        yaw_rad: Direction.
        low_m: (3,) lower corner of the room, in the frame of the pose.
        high_m: (3,) upper corner.
    """

    name: str
    description: str
    tags: tuple[str, ...]
    position_m: Float64Array
    yaw_rad: float
    low_m: Float64Array
    high_m: Float64Array


def named_poses(network: RoadNetwork) -> dict[str, NamedPose]:
    """All named poses of a map, by name."""
    poses = [*_starts(network), *_junctions(network), *_crosswalks(network)]
    return {pose.name: pose for pose in poses}


def map_extent_m(network: RoadNetwork) -> tuple[Float64Array, Float64Array]:
    """Lower and upper (2,) corner of the area in which things can be, 1 km around all lanes."""
    points_m = np.concatenate([lane.centerline_m[:, :2] for lane in network.lanes.values()])
    return points_m.min(axis=0) - _MARGIN_M, points_m.max(axis=0) + _MARGIN_M


def _starts(network: RoadNetwork) -> Iterator[NamedPose]:
    """Every 20 m on lanes and sidewalks outside junctions, in the direction of the lane."""
    for kind, user in ((LaneKind.DRIVING, "vehicle"), (LaneKind.SIDEWALK, "pedestrian")):
        lanes = [lane for lane in network.lanes_of(kind) if not lane.junction]
        positions = positions_along(lanes, _SPACING_M / 2.0, _SPACING_M)
        for row, s_m in zip(positions.row.tolist(), positions.s_m.tolist(), strict=True):
            lane, half_m = lanes[row], np.array([_SPACING_M, lanes[row].width_m]) / 2.0
            position_m, yaw_rad = network.pose_on_lane(lane.id, s_m)
            yield NamedPose(
                f"start/{lane.id}/{s_m:.0f}",
                f"{s_m:.0f} m from the start of {kind.name.lower()} lane {lane.id}",
                ("start", "spawn", "navigation_goal", user),
                position_m,
                yaw_rad,
                np.append(-half_m, 0.0),
                np.append(half_m, _HEADROOM_M),
            )


def _junctions(network: RoadNetwork) -> Iterator[NamedPose]:
    for junction in network.junctions.values():
        tags = ("junction", "traffic_lights") if junction.signalised else ("junction",)
        outline_m = junction.outline_m - junction.center_m[:2] if len(junction.outline_m) else np.zeros((1, 2))
        words = "with traffic lights" if junction.signalised else "without traffic lights"
        yield _area(f"junction/{junction.id}", f"junction {words}", tags, junction.center_m, 0.0, outline_m)


def _crosswalks(network: RoadNetwork) -> Iterator[NamedPose]:
    """In the direction in which people walk."""
    for number, crosswalk in enumerate(network.layout.crosswalks, start=1):
        ahead, center_m = crosswalk.axis, crosswalk.outline_m.mean(axis=0)
        own = np.column_stack([ahead, (-ahead[1], ahead[0])])
        outline_m = (crosswalk.outline_m - center_m)[:, :2] @ own
        yaw_rad = float(np.arctan2(ahead[1], ahead[0]))
        yield _area(f"crosswalk/{number}", "crosswalk", ("crosswalk", "pedestrian"), center_m, yaw_rad, outline_m)


def _area(
    name: str, words: str, tags: tuple[str, ...], center_m: Float64Array, yaw_rad: float, outline_m: Float64Array
) -> NamedPose:
    """A named pose with room for an (N, 2) outline in its frame."""
    low_m, high_m = np.append(outline_m.min(axis=0), 0.0), np.append(outline_m.max(axis=0), _HEADROOM_M)
    return NamedPose(name, words, tags, center_m, yaw_rad, low_m, high_m)
