"""The weights that come with the package give the stored figures on five frames of the test split.

``five_frames.npz.xz`` holds, for each frame: differences of successive points of its sweeps (cm, ego frame of their
stamp), their numbers, poses of the ego, the grid, and the boxes.
"""

import io
import lzma
from pathlib import Path

import numpy as np
import pytest

from simbev_ros.baselines.frames import points_of_frame
from simbev_ros.baselines.inference import Baseline, weights_file
from simbev_ros.baselines.modality import Modality
from simbev_ros.semantics import BEV_CLASSES
from simbev_ros.types import AnyArray

FRAMES = Path(__file__).with_name("five_frames.npz.xz")
MAX_BYTES = 15_000_000
FIGURES = {
    "Town01-0003": (0.715, 0.519, 1.000, 0.966),
    "Town03-0016": (0.612, 0.577, 0.938, 0.818),
    "Town05-0036": (0.636, 0.627, 0.947, 0.833),
    "Town06-0046": (0.783, 0.787, 1.000, 0.933),
    "Town10HD-0066": (0.653, 0.545, 1.000, 0.846),
}
"""IoU of road and of car, recall and precision of boxes, by frame."""


@pytest.fixture(scope="module")
def stored() -> dict[str, AnyArray]:
    with np.load(io.BytesIO(lzma.decompress(FRAMES.read_bytes()))) as arrays:
        return dict(arrays)


@pytest.fixture(scope="module")
def lidar() -> Baseline:
    return Baseline(weights_file(Modality.LIDAR), gpu=False)


def points_of(stored: dict[str, AnyArray], frame: str) -> AnyArray:
    points = np.cumsum(stored[f"{frame}/steps"].T, axis=0, dtype=np.int16).astype(np.float32) / 100
    sweeps = np.split(points, np.cumsum(stored[f"{frame}/counts"])[:-1])
    return points_of_frame(sweeps, list(stored[f"{frame}/poses"]))


def iou(scores: AnyArray, cells: AnyArray, name: str) -> float:
    """IoU of a class at a score of one half."""
    bit = BEV_CLASSES.index(name)
    predicted, true = scores[..., bit] >= 128, (cells >> bit & 1).astype(np.bool_)
    return float((predicted & true).sum() / (predicted | true).sum())


def recall_and_precision(predicted: AnyArray, true: AnyArray) -> tuple[float, float]:
    """Share of seen boxes within 50 m that a predicted one is near, and of predicted ones that are near a true one."""
    near = np.hypot(predicted["x"][:, None] - true["x"], predicted["y"][:, None] - true["y"]) < 2.0
    near &= predicted["class"][:, None] == true["class"]
    seen = (true["points"] >= 5) & (np.hypot(true["x"], true["y"]) < 50)
    close = np.hypot(predicted["x"], predicted["y"]) < 50
    return float(near.any(0)[seen].mean()), float(near.any(1)[close].mean())


@pytest.mark.parametrize("frame", FIGURES)
def test_lidar_gives_the_stored_figures(stored: dict[str, AnyArray], lidar: Baseline, frame: str) -> None:
    answer = lidar.answer(points_of(stored, frame))
    boxes = answer.boxes[answer.boxes["score"] >= 0.3]
    figures = [iou(answer.cells, stored[f"{frame}/cells"], name) for name in ("road", "car")]
    figures += recall_and_precision(boxes, stored[f"{frame}/boxes"])
    assert figures == pytest.approx(FIGURES[frame], abs=0.01)


@pytest.mark.parametrize("file", sorted(weights_file(Modality.LIDAR).parent.glob("*.onnx")), ids=lambda file: file.stem)
def test_weights_are_small_and_have_a_card(file: Path) -> None:
    assert file.stat().st_size <= MAX_BYTES
    card = file.with_suffix(".md").read_text(encoding="utf-8")
    assert all(f"## {title}" in card for title in ("Data", "Training", "Figures", "Limits"))
