"""The weights that come with the package give the stored figures on five frames of the test split.

``five_frames.npz.xz`` holds, for each frame: differences of successive points of its sweeps (cm, ego frame of their
stamp), their numbers, poses of the ego, the JPEG images one behind the other with their sizes, projections, the grid,
and the boxes; and once the ages of the sweeps. The scenes are older than those that the weights were trained on, and
their lidar has 64 rings.
"""

import io
import lzma
from pathlib import Path

import numpy as np
import pytest
import simplejpeg

from simbev_ros.baselines.frames import points_of_frame
from simbev_ros.baselines.inference import Baseline, weights_file
from simbev_ros.baselines.modality import Modality
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray, Float32Array, UInt8Array

FRAMES = Path(__file__).with_name("five_frames.npz.xz")
MAX_BYTES = 15_000_000
FIGURES = {
    Modality.CAMERA: {
        "Town01-0003": (0.647, 0.342, 0.667, 1.000),
        "Town03-0016": (0.417, 0.258, 0.625, 0.833),
        "Town05-0036": (0.636, 0.223, 0.474, 0.692),
        "Town06-0046": (0.605, 0.136, 0.286, 0.308),
        "Town10HD-0066": (0.641, 0.194, 0.167, 1.000),
    },
    Modality.LIDAR: {
        "Town01-0003": (0.729, 0.496, 1.000, 1.000),
        "Town03-0016": (0.628, 0.546, 0.875, 0.864),
        "Town05-0036": (0.785, 0.614, 0.895, 0.893),
        "Town06-0046": (0.831, 0.681, 1.000, 1.000),
        "Town10HD-0066": (0.866, 0.421, 1.000, 1.000),
    },
    Modality.FUSED: {
        "Town01-0003": (0.713, 0.493, 1.000, 1.000),
        "Town03-0016": (0.634, 0.515, 0.938, 0.905),
        "Town05-0036": (0.774, 0.598, 0.895, 0.857),
        "Town06-0046": (0.815, 0.712, 1.000, 1.000),
        "Town10HD-0066": (0.846, 0.421, 1.000, 1.000),
    },
}
"""IoU of road and of car, recall and precision of boxes, by baseline and frame."""


@pytest.fixture(scope="module")
def stored() -> dict[str, AnyArray]:
    with np.load(io.BytesIO(lzma.decompress(FRAMES.read_bytes()))) as arrays:
        return dict(arrays)


@pytest.fixture(scope="module", params=FIGURES)
def baseline(request: pytest.FixtureRequest) -> Baseline:
    return Baseline(weights_file(request.param), gpu=False)


def points_of(stored: dict[str, AnyArray], frame: str, ages_ns: tuple[int, ...]) -> Float32Array:
    """Points of the sweeps of some ages."""
    points = np.cumsum(stored[f"{frame}/steps"].T, axis=0, dtype=np.int16).astype(np.float32) / 100
    sweeps = np.split(points, np.cumsum(stored[f"{frame}/counts"])[:-1])
    chosen = [stored["ages_ns"].tolist().index(age_ns) for age_ns in ages_ns]
    return points_of_frame([sweeps[index] for index in chosen], [stored[f"{frame}/poses"][index] for index in chosen])


def images_of(stored: dict[str, AnyArray], frame: str) -> list[UInt8Array]:
    jpegs = np.split(stored[f"{frame}/jpegs"], np.cumsum(stored[f"{frame}/jpeg_sizes"])[:-1])
    return [simplejpeg.decode_jpeg(jpeg.tobytes(), colorspace="RGB") for jpeg in jpegs]


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


@pytest.mark.parametrize(
    "frame",
    [pytest.param(name, marks=pytest.mark.slow if index else ()) for index, name in enumerate(FIGURES[Modality.LIDAR])],
)
def test_weights_give_the_stored_figures(stored: dict[str, AnyArray], baseline: Baseline, frame: str) -> None:
    points = points_of(stored, frame, baseline.sweep_ages_ns)
    answer = baseline.answer(points, images_of(stored, frame), stored[f"{frame}/pixel_from_level"])
    boxes = answer.boxes[answer.boxes["score"] >= 0.3]
    figures = [iou(answer.cells, stored[f"{frame}/cells"], name) for name in ("road", "car")]
    figures += recall_and_precision(boxes, stored[f"{frame}/boxes"])
    assert figures == pytest.approx(FIGURES[baseline.modality][frame], abs=0.01)


@pytest.mark.parametrize("file", sorted(weights_file(Modality.LIDAR).parent.glob("*.onnx")), ids=lambda file: file.stem)
def test_weights_are_small_and_have_a_card(file: Path) -> None:
    assert file.stat().st_size <= MAX_BYTES
    card = file.with_suffix(".md").read_text(encoding="utf-8")
    assert all(f"## {title}" in card for title in ("Data", "Training", "Figures", "Limits"))


def test_all_weights_have_figures() -> None:
    assert {weights_file(modality) for modality in FIGURES} == set(weights_file(Modality.LIDAR).parent.glob("*.onnx"))
