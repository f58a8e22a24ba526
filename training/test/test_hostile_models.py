"""Models from elsewhere: whatever is in the file, it is read or refused with one line."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs it: pip install ./training[torch]")
onnx = pytest.importorskip("onnx", reason="training needs it: pip install ./training[torch]")

from simbev_ros.baselines.inference import ABOUT_KEY  # noqa: E402
from simbev_ros.baselines.modality import Modality  # noqa: E402
from simbev_ros.foundation.errors import InputError  # noqa: E402
from simbev_training.model.bev_model import BevModel  # noqa: E402
from simbev_training.training.onnx_weights import read_model  # noqa: E402


def with_metadata(text: str, weights: Sequence[Any] = ()) -> bytes:
    """A model without nodes."""
    made = onnx.helper.make_model(onnx.helper.make_graph([], "none", [], [], weights))
    onnx.helper.set_model_props(made, {ABOUT_KEY: text})
    return bytes(made.SerializeToString())


ABOUT = '{"modality": "lidar", "sweep_ages_s": [0.0]}'
OF_ANOTHER_SHAPE = [
    onnx.numpy_helper.from_array(np.zeros(1, np.float32), f"model.{name}")
    for name in BevModel(Modality.LIDAR).state_dict()
]


@pytest.mark.parametrize(
    "content",
    [
        *map(with_metadata, ("[]", "[" * 100_000, "{", '{"modality": ["x"], "sweep_ages_s": 1}')),
        with_metadata(ABOUT, [onnx.numpy_helper.from_array(np.zeros(3, np.int8), "model.a_int8")]),
        with_metadata(ABOUT, [onnx.TensorProto(name="a", data_type=1, dims=[10**9, 10**3], raw_data=b"123")]),
        with_metadata(ABOUT, [onnx.TensorProto(name="a", data_type=1, dims=[1], data_location=1)]),
        with_metadata(ABOUT, OF_ANOTHER_SHAPE),
    ],
    ids=["list", "deep", "cut off", "modality", "without scale", "short", "elsewhere", "shapes"],
)
def test_a_hostile_model_is_refused_with_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "model.onnx").write_bytes(content)
    with pytest.raises(InputError, match=r"\A\S*model\.onnx: [^\n]*\Z"):
        read_model(tmp_path / "model.onnx")
