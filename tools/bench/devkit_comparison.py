"""Evaluates boxes with the nuscenes-devkit, in a Python installation that has it, for comparison."""

import importlib.util
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from simbev_ros.evaluation.metrics.boxes import NO_ATTRIBUTE, Boxes, Predictions
from simbev_ros.foundation.cache.entries import default_cache_dir
from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Float64Array

DEVKIT = "nuscenes-devkit==1.2.0"

Records = dict[str, list[dict[str, Any]]]


def devkit_environment() -> Path:
    """The folder of the virtual environment with the devkit that the tests make for the user."""
    return default_cache_dir() / DEVKIT.replace("==", "-")


def devkit_python() -> Path | None:
    """The Python executable that has the devkit: this one, or that of the environment; None: there is none."""
    if importlib.util.find_spec("nuscenes") is not None:
        return Path(sys.executable)
    folder = devkit_environment()
    return folder / "bin/python" if (folder / "ready").exists() else None


def devkit_numbers(
    python: Path, truth: Boxes, predictions: Predictions, frames: Sequence[int], attributes: Sequence[str] = ()
) -> dict[str, Any]:
    """Metrics of predictions by the devkit, and the ``seconds`` that it took.

    Args:
        python: Executable of a Python installation with the devkit.
        truth: Ground-truth boxes of classes that the devkit knows.
        predictions: Predicted boxes of such classes.
        frames: Numbers of all frames to evaluate.
        attributes: Names of the boxes' attributes, by their numbers.

    Raises:
        SimbevError: The devkit fails.
    """
    content = {
        "truth": devkit_records(truth, None, frames, attributes),
        "predictions": devkit_records(predictions.boxes, predictions.score, frames, attributes),
    }
    with tempfile.TemporaryDirectory(prefix="simbev_ros-devkit-") as folder:
        boxes, out = Path(folder) / "boxes.json", Path(folder) / "numbers.json"
        boxes.write_text(json.dumps(content), encoding="utf-8")
        words = [str(python), str(files("tools.bench").joinpath("devkit_numbers.py")), str(boxes), str(out)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        if done.returncode:
            raise SimbevError(f"{DEVKIT}: {done.stderr.strip().rpartition(chr(10))[2]}")
        numbers: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
    return numbers


def devkit_records(
    boxes: Boxes, score: Float64Array | None, frames: Sequence[int], attributes: Sequence[str] = ()
) -> Records:
    """Boxes in the format of the devkit, with frame numbers as sample tokens; ground truth has no scores."""
    records: Records = {str(frame): [] for frame in frames}
    for record in _records(boxes, score, attributes):
        records[record["sample_token"]].append(record)
    return records


def _records(boxes: Boxes, score: Float64Array | None, attributes: Sequence[str]) -> Iterator[dict[str, Any]]:
    half_rad, nothing = boxes.yaw_rad / 2, np.zeros(len(boxes))
    columns = {
        "translation": boxes.center_m,
        "size": boxes.size_m[:, [1, 0, 2]],
        "rotation": np.column_stack([np.cos(half_rad), nothing, nothing, np.sin(half_rad)]),
        "velocity": boxes.velocity_mps[:, :2],
        "detection_score": nothing - 1 if score is None else score,
    }
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    words = zip(boxes.frame.tolist(), boxes.label.tolist(), boxes.attribute.tolist(), strict=True)
    for row, (frame, label, attribute) in zip(rows, words, strict=True):
        yield {
            "sample_token": str(frame),
            **dict(zip(columns, row, strict=True)),
            "detection_name": BOX_CLASSES[label],
            "attribute_name": "" if attribute == NO_ATTRIBUTE else attributes[attribute],
        }
