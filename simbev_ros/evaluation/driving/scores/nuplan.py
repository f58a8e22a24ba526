"""nuPlan's closed-loop score: four multipliers and the weighted mean of four metrics.

Source: motional/nuplan-devkit, docs/metrics_description.md (v1.2). nuPlan measures progress against a recorded expert;
here the expert completes the route.
"""

import math
from collections.abc import Mapping
from typing import Any

from simbev_ros.evaluation.driving.drive_record import DriveRecord
from simbev_ros.evaluation.driving.infractions import COLLISIONS, InfractionKind
from simbev_ros.evaluation.driving.motion import coefficients, is_comfortable
from simbev_ros.evaluation.driving.rules.time_to_collision import MIN_TIME_S


def nuplan(drive: DriveRecord) -> dict[str, float]:
    """Score from 0 to 1, with its multipliers and metrics."""
    numbers: Mapping[str, Any] = coefficients("nuplan")
    half_m, none_m = numbers["oncoming_m"]
    metrics = {
        "progress": min(drive.completed, 1.0),
        "time_to_collision": float(drive.min_time_to_collision_s >= MIN_TIME_S),
        "speed_limit": _speed_limit(drive, float(numbers["max_overspeed_mps"])),
        "comfort": float(is_comfortable(drive.comfort).all()),
    }
    multipliers = {
        "no_at_fault_collision": _collisions(drive, int(numbers["max_object_collisions"])),
        "drivable_area": float(drive.max_off_road_m <= numbers["max_off_road_m"]),
        "driving_direction": 1.0 if drive.max_oncoming_m <= half_m else 0.5 if drive.max_oncoming_m <= none_m else 0.0,
        "making_progress": float(drive.completed > numbers["min_progress"]),
    }
    weights = numbers["weights"]
    score = math.fsum(weights[name] * value for name, value in metrics.items()) / sum(weights.values())
    for factor in multipliers.values():
        score *= factor
    return {"score": score, **multipliers, **metrics}


def _collisions(drive: DriveRecord, max_objects: int) -> float:
    """1 without a collision at fault, 0.5 if few things were hit but neither a vehicle nor a person, else 0."""
    faults = [each for each in drive.of_kind(*COLLISIONS) if each.at_fault]
    if any(each.kind is not InfractionKind.STATIC_COLLISION for each in faults):
        return 0.0
    return 1.0 if not faults else 0.5 if len(faults) <= max_objects else 0.0


def _speed_limit(drive: DriveRecord, max_overspeed_mps: float) -> float:
    """1 minus the mean excess over the limit, as a share of the maximum."""
    if not drive.ticks:
        return 1.0
    return max(0.0, 1.0 - drive.overspeed_m / (max_overspeed_mps * drive.duration_s))
