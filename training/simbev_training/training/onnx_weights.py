"""Weights in ONNX files: stored with 16 or 8 bits, and read back as the start of a run or as a part of an ensemble."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import onnx
import torch
from onnx import TensorProto, external_data_helper, helper, numpy_helper
from torch import Tensor, nn

from simbev_ros.baselines.inference import ABOUT_KEY
from simbev_ros.baselines.modality import Modality
from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_training.model.bev_model import BevModel

_MIN_SHRUNK = 256
"""Smaller constants keep their precision."""
_HALF, _INT8, _SCALE, _RESTORED = "_half", "_int8", "_scale", "_restored"
_MAX_INT8 = 127.0
_MODEL = "model."
"""Begins the names of all weights: that of the model within ``export.ExportedModel``."""


def shrink_weights(graph: onnx.GraphProto, weights: Literal["half", "int8"]) -> None:
    """Store large constants with fewer bits; nodes, which ONNX Runtime carries out once, restore their type.

    Args:
        graph: The graph; it is changed in place.
        weights: ``half``, or ``int8`` for kernels, with the scale of each output channel from its largest weight.
    """
    nodes = []
    for tensor in list(graph.initializer):
        values = numpy_helper.to_array(tensor)
        if tensor.data_type != TensorProto.FLOAT or values.size < _MIN_SHRUNK:
            continue
        graph.initializer.remove(tensor)
        if weights == "int8" and values.ndim > 1:
            scale = np.abs(values).max(axis=tuple(range(1, values.ndim)), keepdims=True) / _MAX_INT8
            scale[scale == 0] = 1.0
            stored, restored = np.rint(values / scale).astype(np.int8), f"{tensor.name}{_RESTORED}"
            graph.initializer.append(numpy_helper.from_array(stored, f"{tensor.name}{_INT8}"))
            graph.initializer.append(numpy_helper.from_array(scale, f"{tensor.name}{_SCALE}"))
            nodes.append(helper.make_node("Cast", [f"{tensor.name}{_INT8}"], [restored], to=TensorProto.FLOAT))
            nodes.append(helper.make_node("Mul", [restored, f"{tensor.name}{_SCALE}"], [tensor.name]))
        else:
            half = f"{tensor.name}{_HALF}"
            graph.initializer.append(numpy_helper.from_array(values.astype("float16"), half))
            nodes.append(helper.make_node("Cast", [half], [tensor.name], to=TensorProto.FLOAT))
    for node in reversed(nodes):
        graph.node.insert(0, node)


def start_from(model: nn.Module, files: Sequence[Path]) -> None:
    """Give a model the weights of exported ones, by name, where the sizes are the same.

    A fused model can so start from a lidar and a camera model, as BEVFusion does (https://arxiv.org/abs/2205.13542),
    and a model for other data from one that is trained.

    Args:
        model: The model; weights that no file has stay.
        files: ONNX files; where several have a weight, the last one's is taken.

    Raises:
        InputError: A file cannot be read, or has no weight that fits.
    """
    own = model.state_dict()
    for file in files:
        with foreign_content(file):
            weights = _weights(load_model_file(file))
        fitting = {name: each for name, each in weights.items() if name in own and own[name].shape == each.shape}
        if not fitting:
            raise InputError(f"{file}: has no weights of this model; start_from takes what `simbev train` wrote")
        model.load_state_dict(fitting, strict=False)


def read_model(file: Path) -> tuple[BevModel, dict[str, Any]]:
    """Read an exported model back, without the others of an ensemble, and what its metadata says of it.

    Raises:
        InputError: The file cannot be read, or is not a model that ``simbev train`` wrote.
    """
    exported = load_model_file(file)
    texts = [each.value for each in exported.metadata_props if each.key == ABOUT_KEY]
    with foreign_content(file):
        about: dict[str, Any] = parse_json(texts[0]) if texts else {}
        if not {"modality", "sweep_ages_s"} <= about.keys():
            raise InputError(f"{file}: is not a baseline of simbev_ros; `simbev train` writes such files")
        model = BevModel(Modality(about["modality"])).eval()
        weights = _weights(exported)
        own = model.state_dict()
        missing = [name for name, each in own.items() if each.is_floating_point() and name not in weights]
        if missing:
            raise InputError(f"{file}: has no weights {', '.join(missing[:3])}; export it with this version")
        model.load_state_dict({name: each for name, each in weights.items() if name in own}, strict=False)
    return model, about


def load_model_file(file: Path) -> onnx.ModelProto:
    """An ONNX file, unless it cannot be read: then InputError is raised."""
    try:
        return onnx.load(str(file), load_external_data=False)
    except Exception as error:  # a damaged file raises an error of protobuf, which onnx does not name
        raise InputError(
            f"{file}: cannot be read: {' '.join(str(error).split()) or type(error).__name__:.200}"
        ) from None


def _weights(exported: onnx.ModelProto) -> dict[str, Tensor]:
    """Weights and statistics by their names in the model."""
    graph = exported.graph
    if any(external_data_helper.uses_external_data(each) for each in graph.initializer):
        raise ValueError("its weights are in other files")
    stored = {each.name: numpy_helper.to_array(each) for each in graph.initializer}
    constants = {name.removesuffix(_HALF): values for name, values in stored.items()}
    for name, values in stored.items():
        if name.endswith(_INT8):
            whole = name.removesuffix(_INT8)
            constants[whole] = values * stored[f"{whole}{_SCALE}"]
    for node in graph.node:  # of equal weights, the export keeps one
        if node.op_type == "Identity" and node.input[0] in constants:
            constants[node.output[0]] = constants[node.input[0]]
    return {
        name.removeprefix(_MODEL): torch.from_numpy(values.astype("float32"))
        for name, values in constants.items()
        if values.dtype.kind == "f"
    }
