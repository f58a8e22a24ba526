"""The people who work in a work zone."""

from collections.abc import Iterator, Sequence

import numpy as np

from simbev_ros.config.draw import sample
from simbev_ros.config.hazards import Hazards
from simbev_ros.random import stream
from simbev_ros.scene.blueprints import blueprint_index, load_blueprints
from simbev_ros.scene.hazard_area import HazardArea
from simbev_ros.scene.hazard_guards import BARRIER_M
from simbev_ros.scene.hazards import PropSpec
from simbev_ros.scene.spec import VehicleSpec
from simbev_ros.types import Float64Array

_WORKER = "prop.worker"
_TRIES = 12
_CLEAR_M = 0.6  # between a worker's middle and all else


def workers(
    config: Hazards, area: HazardArea, vehicles: Sequence[VehicleSpec], seed: int, name: str
) -> Iterator[PropSpec]:
    """Workers in the body of a work zone, clear of its vehicles; whoever finds no place is left out."""
    rng = stream(seed, f"{name}.workers")
    begin_m, end_m = area.body_m
    there: list[Float64Array] = []
    for _ in range(round(sample(config.workers, rng))):
        for _ in range(_TRIES):
            along_m = rng.uniform(begin_m + BARRIER_M + _CLEAR_M, end_m - BARRIER_M - _CLEAR_M)
            place = area.place(along_m, rng.uniform(_CLEAR_M, area.width_m - 2.0 * _CLEAR_M))
            yaw_rad = rng.uniform(-np.pi, np.pi)
            gaps_m = [_gap_m(vehicle, place.position_m) for vehicle in vehicles]
            gaps_m += [float(np.linalg.norm(other - place.position_m)) - _CLEAR_M for other in there]
            if min(gaps_m, default=np.inf) > _CLEAR_M:
                there.append(place.position_m)
                x_m, y_m, z_m = place.position_m.tolist()
                yield PropSpec(blueprint=_WORKER, x_m=x_m, y_m=y_m, z_m=z_m, yaw_rad=yaw_rad)
                break


def _gap_m(vehicle: VehicleSpec, position_m: Float64Array) -> float:
    """From a vehicle that stands to a (3,) place."""
    stand = vehicle.stands_at
    assert stand is not None
    blueprint = load_blueprints()[blueprint_index()[vehicle.blueprint]]
    offset_m = position_m[:2] - [stand.x_m, stand.y_m]
    cosine, sine = np.cos(stand.yaw_rad), np.sin(stand.yaw_rad)
    ahead_m, left_m = offset_m @ [cosine, sine], offset_m @ [-sine, cosine]
    outside_m = np.abs([ahead_m, left_m]) - np.array(blueprint.size_m[:2]) / 2.0
    return float(np.linalg.norm(np.maximum(outside_m, 0.0)))
