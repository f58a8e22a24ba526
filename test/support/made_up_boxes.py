"""Boxes for tests of the metrics: hand-made ones, and random ones with partly correct predictions."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from simbev_ros.evaluation.metrics.boxes import NO_ATTRIBUTE, Boxes, Predictions
from simbev_ros.foundation.semantics import BOX_CLASSES


def some_boxes(centers_m: Sequence[Sequence[float]], **columns: Any) -> Boxes:
    """Cars of 4 x 2 x 2 m at rest in frame 0, except for the given columns."""
    count = len(centers_m)
    values = {
        "frame": 0,
        "label": BOX_CLASSES.index("car"),
        "size_m": (4.0, 2.0, 2.0),
        "yaw_rad": 0.0,
        "velocity_mps": 0.0,
        "attribute": NO_ATTRIBUTE,
        **columns,
    }

    def column(name: str, dtype: type, width: int | None = None) -> Any:
        shape = (count,) if width is None else (count, width)
        return np.broadcast_to(np.asarray(values[name], dtype), shape).copy()

    return Boxes(
        column("frame", np.int64),
        column("label", np.uint8),
        np.asarray(centers_m, np.float64).reshape(count, 3),
        column("size_m", np.float64, 3),
        column("yaw_rad", np.float64),
        column("velocity_mps", np.float64, 3),
        column("attribute", np.uint8),
    )


def random_truth(rng: np.random.Generator, frames: int, per_frame: int) -> Boxes:
    """Boxes of all classes, as dense as in a crowd."""
    count = frames * per_frame
    return some_boxes(
        rng.uniform([-25, -25, -1], [25, 25, 1], (count, 3)),
        frame=np.repeat(np.arange(frames), per_frame),
        label=rng.integers(0, len(BOX_CLASSES), count),
        size_m=rng.uniform(0.4, 5.0, (count, 3)),
        yaw_rad=rng.uniform(-np.pi, np.pi, count),
        velocity_mps=rng.normal(0, 3, (count, 3)),
        attribute=rng.choice([0, 1, 2, NO_ATTRIBUTE], count),
    )


def random_predictions(rng: np.random.Generator, truth: Boxes, noise: float = 1.0) -> Predictions:
    """Noisy predictions: some boxes twice, some missing, a third far off, and many equal scores."""
    chosen = np.sort(rng.integers(0, len(truth), len(truth)))
    base, count = truth.take(chosen), len(chosen)
    center_m = base.center_m + rng.normal(0, 1, (count, 3)) * rng.choice([0.1, 0.8, 10.0], (count, 1)) * noise
    velocity_mps = base.velocity_mps + rng.normal(0, 1, (count, 3))
    velocity_mps[rng.random(count) < 0.1] = np.nan
    boxes = Boxes(
        base.frame,
        base.label,
        center_m,
        base.size_m * rng.uniform(1 - 0.3 * noise, 1 + 0.4 * noise, (count, 3)),
        base.yaw_rad + rng.normal(0, noise, count),
        velocity_mps,
        rng.choice(np.array([0, 1, 2, NO_ATTRIBUTE], np.uint8), count),
    )
    return Predictions(boxes, rng.random(count).round(2))
