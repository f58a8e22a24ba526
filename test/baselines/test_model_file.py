"""A baseline's file is found, or refused with a message that says what is wrong with it."""

import subprocess
import sys
from pathlib import Path

import pytest

from simbev_ros.baselines.inference import ABOUT_KEY, weights_file
from simbev_ros.baselines.modality import Modality
from simbev_ros.baselines.model_file import load_baseline
from simbev_ros.foundation.errors import InputError


def test_a_file_that_is_no_model_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime", reason="ONNX Runtime is not installed")
    (tmp_path / "model.onnx").write_bytes(b"no model")
    with pytest.raises(InputError, match=r"model\.onnx: cannot be loaded: "):
        load_baseline(Modality.LIDAR, tmp_path / "model.onnx")


@pytest.mark.slow
def test_a_model_that_sees_something_else_is_refused(tmp_path: Path) -> None:
    for package in ("torch", "onnx", "onnxruntime"):
        pytest.importorskip(package, reason=f"{package} is not installed")
    from untrained_baseline import export_untrained

    path = export_untrained(tmp_path / "model.onnx", Modality.LIDAR)
    assert load_baseline(Modality.LIDAR, path).modality is Modality.LIDAR
    with pytest.raises(InputError, match=f"^{path}: is a lidar model, which baseline-lidar runs$"):
        load_baseline(Modality.FUSED, path)


def test_the_node_ends_with_exit_code_2_and_one_line_if_there_is_no_such_file(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "simbev_ros.baselines.node", "lidar", str(tmp_path / "none.onnx")]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert (
        ended.stderr.startswith(f"error: {tmp_path}/none.onnx: there is no such file") and ended.stderr.count("\n") == 1
    )


@pytest.mark.slow
def test_a_model_that_does_not_say_what_it_takes_is_refused(tmp_path: Path) -> None:
    for package in ("torch", "onnx", "onnxruntime"):
        pytest.importorskip(package, reason=f"{package} is not installed")
    from untrained_baseline import export_untrained

    path = export_untrained(tmp_path / "model.onnx", Modality.LIDAR, about={"modality": "lidar"})
    with pytest.raises(InputError, match=r"model\.onnx: says no sweep_ages_s; export it with this version"):
        load_baseline(Modality.LIDAR, path)


def with_metadata(text: bytes, path: Path) -> Path:
    """The shipped lidar model with another text about itself: of repeated fields of a protobuf file the last counts."""

    def field(number: int, content: bytes) -> bytes:
        size, varint = len(content), b""
        while size > 127:
            varint, size = varint + bytes([size & 127 | 128]), size >> 7
        return bytes([number << 3 | 2]) + varint + bytes([size]) + content

    entry = field(1, ABOUT_KEY.encode()) + field(2, text)
    path.write_bytes(weights_file(Modality.LIDAR).read_bytes() + field(14, entry))
    return path


def test_a_model_with_other_metadata_loads(tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime", reason="ONNX Runtime is not installed")
    text = b'{"modality": "lidar", "sweep_ages_s": [0, 0.5]}'
    assert load_baseline(Modality.LIDAR, with_metadata(text, tmp_path / "a.onnx")).sweep_ages_ns == (0, 500_000_000)


@pytest.mark.parametrize(
    "text",
    [
        b"{",
        b"\xff",
        b"[]",
        b"7",
        b"null",
        b"[" * 100_000,
        b'{"modality": "sonar", "sweep_ages_s": [0]}',
        b'{"modality": ["lidar"], "sweep_ages_s": [0]}',
        b'{"modality": "lidar", "sweep_ages_s": 0}',
        b'{"modality": "lidar", "sweep_ages_s": [null]}',
        b'{"modality": "lidar", "sweep_ages_s": [NaN]}',
        b'{"modality": "lidar", "sweep_ages_s": [1e999]}',
        b'{"modality": "lidar", "sweep_ages_s": {"a": "b"}}',
        b'{"modality": "lidar", "sweep_ages_s": ["a"]}',
        b'{"modality": "lidar", "sweep_ages_s": []}',
        b'{"modality": "lidar", "sweep_ages_s": [-1, 0]}',
        b'{"modality": "lidar", "sweep_ages_s": [1, 0]}',
        b'{"modality": "lidar", "sweep_ages_s": [' + b",".join(b"%d" % age for age in range(65)) + b"]}",
    ],
)
def test_hostile_metadata_are_refused_in_one_line(tmp_path: Path, text: bytes) -> None:
    pytest.importorskip("onnxruntime", reason="ONNX Runtime is not installed")
    with pytest.raises(InputError, match=r"a\.onnx: ") as caught:
        load_baseline(Modality.LIDAR, with_metadata(text, tmp_path / "a.onnx"))
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 500
