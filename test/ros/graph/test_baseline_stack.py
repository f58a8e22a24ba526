"""A baseline, untrained, answers every due frame of a graph in lockstep, and its figures are printed at the end."""

import json
from pathlib import Path

import pytest
from commands import Config, Simbev

from simbev_ros.baselines.modality import Modality

pytest.importorskip("torch", reason="torch exports the model that stands in")
pytest.importorskip("onnx", reason="torch exports the model that stands in")
pytestmark = [pytest.mark.graph, pytest.mark.slow]

RATES = {
    Modality.LIDAR: ("columns: 128", "columns: 128, rate_hz: 10", ("camera", "radar", "gnss", "imu")),
    Modality.FUSED: ("rate_hz: 10}", "rate_hz: 4}", ("radar", "gnss", "imu")),
}
"""A change of the small configuration, and sensors to leave out."""


@pytest.mark.parametrize(("modality", "frames"), [(Modality.LIDAR, 5), (Modality.FUSED, 2)])
def test_every_due_frame_is_answered_and_evaluated(
    simbev: Simbev, small_config: Config, tmp_path: Path, modality: Modality, frames: int
) -> None:
    from untrained_baseline import export_untrained

    old, new, without = RATES[modality]
    config, file = small_config(0.5, without=without), tmp_path / "figures.json"
    config.write_text(config.read_text().replace(old, new, 1))
    model = export_untrained(tmp_path / "untrained.onnx", modality)
    code, output = simbev("run", config, "--stack", f"baseline-{modality} {model}", "--evaluate", file).finish(300)
    assert code == 0, output
    assert f"{frames} frames of 1 scene; answered: {frames} with boxes, {frames} with" in " ".join(output.split())
    figures = json.loads(file.read_text())
    counts = {name: figures["frames"][name] for name in ("evaluated", "answered_boxes", "answered_grids", "missed")}
    assert counts == {"evaluated": frames, "answered_boxes": frames, "answered_grids": frames, "missed": 0}
    assert figures["frames"]["malformed"] == 0
