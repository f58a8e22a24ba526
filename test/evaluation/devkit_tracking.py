"""Evaluates tracks with the nuscenes-devkit. Run by its own Python, without this project: SCENES → JSON on stdout."""

import json
import sys
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from nuscenes.eval.common.config import config_factory  # type: ignore[import-not-found]
from nuscenes.eval.tracking.data_classes import TrackingBox  # type: ignore[import-not-found]
from nuscenes.eval.tracking.evaluate import TrackingEval  # type: ignore[import-not-found]

NAMES = ("amota", "amotp", "mota", "motp", "recall", "ids", "frag")


def tracks(scenes: list[dict[str, Any]], kind: str) -> dict[str, dict[int, list[TrackingBox]]]:
    """Boxes by scene and frame, with the mean scores of their tracks, as the devkit's loader makes them."""
    found = {}
    for number, scene in enumerate(scenes):
        scores = defaultdict(list)
        for row in scene[kind]:
            scores[row[2]].append(row[5] if len(row) > 5 else -1.0)
        frames: dict[int, list[TrackingBox]] = {frame: [] for frame in range(scene["frames"])}
        for name, frame, track, x, y, *_ in scene[kind]:
            score = float(np.mean(scores[track]))
            frames[frame].append(
                TrackingBox(
                    sample_token="",
                    translation=(x, y, 0.0),
                    tracking_id=str(track),
                    tracking_name=name,
                    tracking_score=score,
                )
            )
        found[str(number)] = frames
    return found


def main(path: str) -> None:
    """Print the metrics by class."""
    scenes = json.loads(Path(path).read_text())
    config = config_factory("tracking_nips_2019")
    truth, predictions = (tracks(scenes, kind) for kind in ("truth", "predictions"))
    evaluation = SimpleNamespace(
        verbose=False, tracks_gt=truth, tracks_pred=predictions, cfg=config, output_dir=None, render_classes=None
    )
    metrics, _ = TrackingEval.evaluate(evaluation)
    classes = sorted({row[0] for scene in scenes for row in scene["truth"]})
    print(json.dumps({each: {name: metrics.label_metrics[name][each] for name in NAMES} for each in classes}))


main(sys.argv[1])
