"""Clearance at the start of a scene: no actor is placed where the body of a vehicle already stands.

This includes long vehicles, vehicles in bends and vehicles beside a lane that merges.
"""

from collections.abc import Iterable

import numpy as np
import shapely

from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import Blueprint, blueprint_named
from simbev_ros.scene.footprints import footprints
from simbev_ros.schema.scene.spec import VehicleSpec, WaypointSpec

_MIN_GAP_M = 0.3


class StartClearance:
    """The ground that a scene's vehicles occupy before anything moves."""

    def __init__(self, network: RoadNetwork, vehicles: Iterable[VehicleSpec] = ()) -> None:
        self._network = network
        self._bodies: list[AnyArray] = []
        for vehicle in vehicles:
            self.occupy(vehicle)

    def occupy(self, vehicle: VehicleSpec) -> None:
        """Occupy the ground of a vehicle at its start."""
        self._bodies.append(self._body(blueprint_named(vehicle.blueprint), vehicle.start))

    def is_free(self, blueprint: Blueprint, start: WaypointSpec, gap_m: float = 0.0) -> bool:
        """Whether a vehicle of this blueprint has room at a start, with a gap before it and behind it."""
        body = self._body(blueprint, start, gap_m)
        return not any(shapely.dwithin(body, np.array(self._bodies, object), _MIN_GAP_M))

    def is_free_at(self, position_m: Float64Array, radius_m: Float64Array) -> BoolArray:
        """(N,) whether no vehicle is within (N,) distances of (N, 2+) positions, map frame."""
        tree = shapely.STRtree(np.array(self._bodies, object))
        blocked, _ = tree.query(shapely.points(position_m[:, :2]), predicate="dwithin", distance=radius_m)
        free: BoolArray = np.ones(len(position_m), bool)
        free[blocked] = False
        return free

    def _body(self, blueprint: Blueprint, start: WaypointSpec, gap_m: float = 0.0) -> AnyArray:
        """Footprint polygon of a vehicle on the chord from its start back along the lane, longer by gaps."""
        front_m, yaw_rad = self._network.pose_on_lane(start.lane, start.s_m)
        length_m, width_m = blueprint.train_length_m, blueprint.turning_footprint.width_m
        if start.s_m > 1.0:
            back_m, _ = self._network.pose_on_lane(start.lane, start.s_m - length_m)
            yaw_rad = float(np.arctan2(*(front_m - back_m)[1::-1]))
        center_m = front_m[:2] - length_m / 2.0 * np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
        return footprints(np.array([length_m + 2.0 * gap_m, width_m]), center_m[None], np.array([yaw_rad]))[0]
