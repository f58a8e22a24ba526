"""``simbev train`` and ``simbev predict`` refuse bad input with one line, before they write anything."""

from collections.abc import Callable
from pathlib import Path

import pytest
from made_up_scene import record_made_up
from several_agents import made_up_agents

pytestmark = pytest.mark.usefixtures("training")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("modality: sonar", "my.yaml:1: modality: Input should be 'camera', 'lidar' or 'fused', not 'sonar'"),
        ("seed: 1", "my.yaml:1: modality: Field required"),
        ("modality: lidar\nepochs: 0", "my.yaml:2: epochs: "),
        ("modality: lidar\nspeed: 3", "my.yaml:2: speed: "),
        ("modality: lidar\naugmentation: {scale: 2}", "my.yaml:2: augmentation.scale: "),
        ("- 1", "my.yaml:1: "),
        ("modality: [", "my.yaml: not valid YAML"),
    ],
)
def test_bad_configurations_of_training(refused: Callable[..., str], tmp_path: Path, text: str, message: str) -> None:
    config = tmp_path / "my.yaml"
    config.write_text(text)
    assert message in refused("train", config, tmp_path, "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_an_unknown_name_of_a_configuration_is_refused(refused: Callable[..., str], tmp_path: Path) -> None:
    error = refused("train", "sonar", tmp_path, "--out", tmp_path / "run")
    assert "sonar: no such file; shipped configurations are camera, fused, lidar" in error


def test_training_needs_a_dataset_and_a_device(refused: Callable[..., str], tmp_path: Path) -> None:
    pytest.importorskip("torch", reason="training needs it: pip install ./training[torch]")
    assert "no such file or folder" in refused("train", "lidar", tmp_path / "none", "--out", tmp_path / "run")
    error = refused("train", "lidar", tmp_path, "--out", tmp_path / "run", "--device", "abacus")
    assert "--device: is 'abacus'" in error


def test_predicting_needs_a_model(refused: Callable[..., str], tmp_path: Path) -> None:
    (tmp_path / "model.onnx").write_bytes(b"nothing")
    assert "cannot be loaded" in refused("predict", tmp_path / "model.onnx", tmp_path, "--out", tmp_path / "p")
    assert "no such file" in refused("predict", tmp_path / "none.onnx", tmp_path, "--out", tmp_path / "p")
    assert not (tmp_path / "p").exists()


def test_an_unknown_agent_is_named_with_those_that_there_are(refused: Callable[..., str], tmp_path: Path) -> None:
    record_made_up(tmp_path / "set/scenes/test/Blocks-0002", made_up_agents())
    error = refused("predict", "lidar", tmp_path / "set", "--out", tmp_path / "p", "--agent", "bus")
    assert error == f"error: --agent 'bus': {tmp_path / 'set'} has ego, car, rsu\n"
    assert [path.name for path in tmp_path.iterdir()] == ["set"]
