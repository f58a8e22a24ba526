"""Room at the start: nobody is put where a vehicle's body stands, be it long, in a bend or beside a lane that joins."""

import numpy as np
import shapely

from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import Blueprint, blueprint_index, load_blueprints
from simbev_ros.scene.footprints import footprints
from simbev_ros.scene.spec import VehicleSpec, WaypointSpec
from simbev_ros.types import AnyArray, BoolArray, Float64Array

_APART_M = 0.3


class Room:
    """What the vehicles of a scene take up before anybody moves."""

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        self._bodies: list[AnyArray] = []

    def take(self, vehicle: VehicleSpec) -> None:
        """Put a vehicle at its start."""
        self._bodies.append(self._body(load_blueprints()[blueprint_index()[vehicle.blueprint]], vehicle.start))

    def is_free(self, blueprint: Blueprint, start: WaypointSpec) -> bool:
        """Whether there is room for a vehicle."""
        body = self._body(blueprint, start)
        return not any(shapely.dwithin(body, np.array(self._bodies, object), _APART_M))

    def is_free_at(self, place_m: Float64Array, around_m: Float64Array) -> BoolArray:
        """(N,) whether no vehicle is within (N,) distances of (N, 2) or more columns, map frame."""
        tree = shapely.STRtree(np.array(self._bodies, object))
        taken, _ = tree.query(shapely.points(place_m[:, :2]), predicate="dwithin", distance=around_m)
        free: BoolArray = np.ones(len(place_m), bool)
        free[taken] = False
        return free

    def _body(self, blueprint: Blueprint, start: WaypointSpec) -> AnyArray:
        """Polygon of a vehicle that lies on the chord from its start back along the lane."""
        front_m, yaw_rad = self._network.pose_on_lane(start.lane, start.s_m)
        length_m = blueprint.size_m[0]
        if start.s_m > 1.0:
            back_m, _ = self._network.pose_on_lane(start.lane, start.s_m - length_m)
            yaw_rad = float(np.arctan2(*(front_m - back_m)[1::-1]))
        middle_m = front_m[:2] - length_m / 2.0 * np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
        body: AnyArray = footprints(np.array(blueprint.size_m), middle_m[None], np.array([yaw_rad]))[0]
        return body
