"""Predictions for tests, as columns, and the stamps of their frames."""

from typing import Any

import numpy as np

from simbev_ros.foundation.types import AnyArray

SCENE, OTHER = "Blocks-0000", "Blocks-0001"
STAMPS_NS = 3_600_050_000_000 + 50_000_000 * np.arange(4)


def some_columns(**changes: Any) -> dict[str, AnyArray]:
    """Three boxes of two scenes; None removes a column."""
    columns = {
        "scene": np.array([SCENE, OTHER, SCENE]),
        "tick": np.array([0, 2, 3]),
        "class": np.array(["car", "bus", "pedestrian"]),
        "score": np.array([0.5, 0.25, 1.0]),
        "x": np.array([1.0, 2.0, 3.0]),
        "y": np.array([-1.0, 0.0, 1.0]),
        "z": np.array([0.5, 0.5, 0.5]),
        "length": np.array([4.0, 10.0, 0.5]),
        "width": np.array([2.0, 2.5, 0.5]),
        "height": np.array([1.5, 3.0, 1.75]),
        "yaw": np.array([0.1, 0.2, 0.3]),
        "vx": np.array([1.0, np.nan, 2.0]),
        "vy": np.array([0.5, np.nan, 0.25]),
    }
    return {name: np.asarray(values) for name, values in {**columns, **changes}.items() if values is not None}
