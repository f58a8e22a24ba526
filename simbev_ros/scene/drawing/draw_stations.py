"""Draw the masts of a scene's roadside units: at given poses, at junctions or above lanes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from simbev_ros.config.places import JunctionPlace, Mast, MastPose, Near, RoadPlace, poses_on
from simbev_ros.foundation.errors import InputError, RoomError
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import OUTSKIRTS_M
from simbev_ros.scene.drawing.nearness import is_near
from simbev_ros.scene.drawing.spawn import Where
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.schema.scene.agent_spec import StationSpec

_MIN_APART_M = 5.0  # between masts in drawn places


@dataclass(frozen=True, slots=True)
class StationDrawer:
    """Draws masts on one map.

    Attributes:
        seed: Seed of the scene.
        network: Roads of the scene's map.
        starts: Positions on them where actors can start, and places for masts.
        spawn_radius_m: ``traffic.spawn_radius_m``.
        others_m: (3,) starts of the agents drawn before, the first agent's first, map frame; the stations are added.
        stations: The stations drawn before; those drawn are added.
    """

    seed: int
    network: RoadNetwork
    starts: StartPositions
    spawn_radius_m: float
    others_m: dict[str, Float64Array]
    stations: list[StationSpec]

    def draw(self, mast: Mast, name: str, where: Where, siblings: Sequence[StationSpec]) -> StationSpec:
        """Draw the mast of an agent.

        Args:
            mast: The configuration.
            name: The agent's name.
            where: Words for the fields of the mast.
            siblings: Stations of the same entry; their poses are not drawn again.

        Raises:
            InputError: A pose is outside the map or on a driving lane.
            RoomError: There is no free place.
        """
        purpose = f"agents.{name}"
        if mast.junction is not None:
            station = self._draw_at_junction(mast.junction, purpose, partial(where, "junction"))
        elif mast.above_road is not None:
            station = self._draw_above_road(mast.above_road, purpose, partial(where, "above_road"))
        else:
            station = self._draw_pose(mast, purpose, where, siblings)
        self.others_m[name] = np.array([station.x_m, station.y_m, station.z_m])
        self.stations.append(station)
        return station

    def _draw_pose(self, mast: Mast, purpose: str, where: Where, siblings: Sequence[StationSpec]) -> StationSpec:
        """Draw one of the poses that no sibling has."""
        keys, poses = poses_on(mast.poses, self.network.name)
        if not poses:
            raise InputError(f"{where('poses')}: has no poses on map {self.network.name}")
        stations = [self._station_at(pose, partial(where, "poses", *keys, number)) for number, pose in enumerate(poses)]
        for number in stream(self.seed, f"{purpose}.place").permutation(len(stations)).tolist():
            if stations[number] not in siblings:
                return stations[number]
        raise InputError(f"{where('poses')}: two of them are equal; each roadside unit needs a pose of its own")

    def _station_at(self, pose: MastPose, where: Where) -> StationSpec:
        """The station at a pose, which is checked."""
        position, map_name = f"({pose.x_m:g}, {pose.y_m:g})", self.network.name
        distance_m = self.starts.masts.distance_m(pose.x_m, pose.y_m)
        if distance_m > OUTSKIRTS_M:
            raise InputError(
                f"{where()}: {position} is {distance_m:.1f} m from the nearest road of map {map_name}; "
                f"at most {OUTSKIRTS_M:g} m is allowed"
            )
        z_m = self.starts.masts.ground_m(pose.x_m, pose.y_m) if pose.z_m is None else pose.z_m
        if self.starts.masts.is_on_lane(np.array([pose.x_m, pose.y_m, z_m])):
            raise InputError(f"{where()}: {position} is on a driving lane of map {map_name}")
        return StationSpec(x_m=pose.x_m, y_m=pose.y_m, z_m=z_m, yaw_rad=math.radians(pose.yaw_deg))

    def _draw_at_junction(self, place: JunctionPlace, purpose: str, where: Where) -> StationSpec:
        """Draw a junction, then a position next to it."""
        masts = self.starts.masts
        centers_m = np.array([crossing.center_m for crossing in masts.crossings]).reshape(-1, 3)
        in_area, area = self._is_near(centers_m, place.near, purpose)
        for index in stream(self.seed, f"{purpose}.place").permutation(len(centers_m)).tolist():
            if not in_area[index] or place.signalised not in (None, masts.crossings[index].signalised):
                continue
            feet_m = self._free(masts.feet_m(index))
            if len(feet_m):
                foot_m = feet_m[int(stream(self.seed, f"{purpose}.foot").integers(len(feet_m)))]
                return _station(foot_m, float(np.arctan2(*(centers_m[index] - foot_m)[1::-1])))
        kind = {None: "a", True: "a signalized", False: "an unsignalized"}[place.signalised]
        raise RoomError(f"{where()}: no free position next to {kind} junction {area} in map {self.network.name}")

    def _draw_above_road(self, place: RoadPlace, purpose: str, where: Where) -> StationSpec:
        """Draw a point of a driving lane under the sky."""
        positions = self.starts.vehicles
        in_area, area = self._is_near(positions.position_m, place.near, purpose)
        order = stream(self.seed, f"{purpose}.place").permutation(len(positions))
        for index in order[np.isin(order, np.flatnonzero(in_area & self.starts.is_under_sky))].tolist():
            if len(self._free(positions.position_m[[index]])):
                point = positions.waypoint(index)
                return _station(*self.network.pose_on_lane(point.lane, point.s_m))
        raise RoomError(f"{where()}: no free point above a driving lane {area} in map {self.network.name}")

    def _is_near(self, positions_m: Float64Array, near: Near | None, purpose: str) -> tuple[BoolArray, str]:
        """``nearness.is_near`` for one of the agents."""
        return is_near(positions_m, near, self.others_m, self.spawn_radius_m, self.seed, purpose)

    def _free(self, feet_m: Float64Array) -> Float64Array:
        """The (K, 3) feet that keep a distance from all masts drawn before."""
        taken_m = np.array([[station.x_m, station.y_m] for station in self.stations]).reshape(-1, 2)
        distance_m = np.linalg.norm(feet_m[:, None, :2] - taken_m, axis=2)
        return feet_m[distance_m.min(axis=1, initial=np.inf) >= _MIN_APART_M]


def _station(foot_m: Float64Array, yaw_rad: float) -> StationSpec:
    x_m, y_m, z_m = foot_m.tolist()
    return StationSpec(x_m=x_m, y_m=y_m, z_m=z_m, yaw_rad=yaw_rad)
