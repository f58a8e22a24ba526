"""Bench2Drive's success, driving efficiency and comfortness.

Source: Jia et al., "Bench2Drive: Towards Multi-Ability Benchmarking of Closed-Loop End-To-End Autonomous Driving",
NeurIPS 2024 (arXiv 2406.03877), section 3.3. Its driving score is that of leaderboard 2.0 without the minimum speed.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from simbev_ros.evaluation.driving.drive_record import DriveRecord
from simbev_ros.evaluation.driving.infractions import InfractionKind
from simbev_ros.evaluation.driving.motion import coefficients, is_comfortable
from simbev_ros.evaluation.driving.scores.leaderboard import counted, leaderboard_2_0
from simbev_ros.schema.scene.route_progress import DriveEnd


def bench2drive(drive: DriveRecord) -> dict[str, float | None]:
    """Success (0 or 1), driving score, efficiency and comfortness in percent; None where nothing can be measured."""
    numbers = coefficients("bench2drive")
    lenient = replace(
        drive, infractions=tuple(each for each in drive.infractions if each.kind is not InfractionKind.MIN_SPEED)
    )
    is_clean = not any(counted(lenient, coefficients("leaderboard_2_0"))) and drive.outside_m == 0.0
    ratios = [later.ratio_since(before) for before, later in pairwise(drive.speed_checks)]
    known = [ratio for ratio in ratios if ratio is not None and ratio <= numbers["max_speed_ratio"]]
    comfort = is_comfortable(drive.comfort)
    segment = max(1, round(numbers["segment_s"] / drive.tick_s))
    smooth = [comfort[start : start + segment].all() for start in range(0, len(comfort) - segment + 1, segment)]
    return {
        "success": float(drive.ended == DriveEnd.GOAL and is_clean),
        "driving_score": leaderboard_2_0(lenient)["driving_score"],
        "efficiency": 100.0 * float(np.mean(known)) if known else None,
        "comfortness": 100.0 * float(np.mean(smooth)) if smooth else None,
    }
