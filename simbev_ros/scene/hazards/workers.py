"""Place the workers of a work zone."""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from simbev_ros.config.draw import sample
from simbev_ros.config.hazards import Hazards
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.random import stream
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.footprints import footprints
from simbev_ros.scene.hazards.area import HazardArea
from simbev_ros.scene.hazards.guards import BARRIER_ROW_M
from simbev_ros.schema.scene.hazard import PropSpec
from simbev_ros.schema.scene.spec import VehicleSpec

_WORKER = "prop.worker"
_TRIES = 12
_CLEARANCE_M = 0.6  # from a worker's center to everything else


def place_workers(
    config: Hazards, area: HazardArea, vehicles: Sequence[VehicleSpec], seed: int, name: str
) -> Iterator[PropSpec]:
    """Draw workers in the body of a work zone, clear of its vehicles; a worker without room is left out."""
    rng = stream(seed, f"{name}.workers")
    start_m, end_m = area.body_m
    stands = [vehicle.stands_at for vehicle in vehicles if vehicle.stands_at is not None]
    sizes_m = [blueprint_named(vehicle.blueprint).size_m[:2] for vehicle in vehicles]
    center_m = np.array([(stand.x_m, stand.y_m) for stand in stands]).reshape(-1, 2)
    boxes = footprints(np.array(sizes_m).reshape(-1, 2), center_m, np.array([stand.yaw_rad for stand in stands]))
    occupied = [overlay.union_all(boxes)]
    for _ in range(round(sample(config.workers, rng))):
        along_m = rng.uniform(start_m + BARRIER_ROW_M + _CLEARANCE_M, end_m - BARRIER_ROW_M - _CLEARANCE_M, _TRIES)
        position_m, _ = area.positions(along_m, rng.uniform(_CLEARANCE_M, area.width_m - 2.0 * _CLEARANCE_M, _TRIES))
        yaw_rad = float(rng.uniform(-np.pi, np.pi))
        points = np.asarray(shapely.points(position_m[:, :2]), object)
        clear = np.flatnonzero(~np.any([shapely.dwithin(points, each, _CLEARANCE_M) for each in occupied], axis=0))
        if len(clear):
            occupied.append(points[clear[0]].buffer(_CLEARANCE_M))
            x_m, y_m, z_m = position_m[clear[0]].tolist()
            yield PropSpec(blueprint=_WORKER, x_m=x_m, y_m=y_m, z_m=z_m, yaw_rad=yaw_rad)
