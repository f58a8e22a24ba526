"""Converts a drive to plain values for JSON: what /drive/score carries, and what tables and pages show."""

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel, FiniteFloat, NonNegativeInt, ValidationError

from simbev_ros.evaluation.driving.drive_record import DriveRecord
from simbev_ros.evaluation.driving.scores.bench2drive import bench2drive
from simbev_ros.evaluation.driving.scores.leaderboard import leaderboard_2_0, leaderboard_2_1
from simbev_ros.evaluation.driving.scores.nuplan import nuplan

SCORES = {
    "leaderboard_2_0": leaderboard_2_0,
    "leaderboard_2_1": leaderboard_2_1,
    "bench2drive": bench2drive,
    "nuplan": nuplan,
}
"""Functions from a drive to a score by name."""


class _Figures(BaseModel):
    """What readers of a drive's figures rely on."""

    ended: str
    completed: FiniteFloat
    infractions: dict[str, NonNegativeInt]
    scores: dict[str, dict[str, FiniteFloat | None]]


def drive_figures(drive: DriveRecord) -> dict[str, Any]:
    """Scores, numbers of infractions by kind, and what was measured; undefined values are null."""
    time_s = drive.min_time_to_collision_s
    return {
        "ended": drive.ended,
        "completed": drive.completed,
        "duration_s": drive.duration_s,
        "driven_m": drive.driven_m,
        "outside_share": drive.outside_share,
        "max_off_road_m": drive.max_off_road_m,
        "max_oncoming_m": drive.max_oncoming_m,
        "min_time_to_collision_s": time_s if math.isfinite(time_s) else None,
        "infractions": dict(sorted(Counter(each.kind.value for each in drive.infractions).items())),
        "scores": {name: score(drive) for name, score in SCORES.items()},
    }


def checked_figures(figures: Any) -> Mapping[str, Any]:
    """Figures of a drive from a bag or a message.

    Raises:
        ValueError: They are none, or contain NaN or infinity, which JSON does not allow.
    """
    try:
        scores = _Figures.model_validate(figures, strict=True).scores
    except ValidationError as error:
        first = error.errors()[0]
        raise ValueError(f"no score of a drive: {'.'.join(map(str, first['loc']))}: {first['msg']}") from None
    if missing := SCORES.keys() - scores.keys():
        raise ValueError(f"no score of a drive: {', '.join(sorted(missing))} is missing")
    json.dumps(figures, allow_nan=False)
    return figures


def drives_figures(scenes: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Means of drives (``mean_figures``), and under ``scenes`` the figures of each, by the name of its scene."""
    return {**mean_figures([*scenes.values()]), "scenes": scenes}


def mean_figures(drives: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Means of the scores over drives, without undefined values, and sums of the infractions."""
    scores: dict[str, dict[str, float | None]] = {}
    for name in SCORES:
        for key in dict.fromkeys(key for drive in drives for key in drive["scores"][name]):
            values = (drive["scores"][name].get(key) for drive in drives)
            known = [value for value in values if value is not None]
            scores.setdefault(name, {})[key] = math.fsum(known) / len(known) if known else None
    counts: Counter[str] = Counter()
    for drive in drives:
        counts.update(drive["infractions"])
    return {"drives": len(drives), "infractions": dict(sorted(counts.items())), "scores": scores}
