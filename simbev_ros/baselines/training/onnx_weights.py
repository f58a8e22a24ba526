"""Weights in ONNX files: stored with half precision, and read back as the start of another run."""

from collections.abc import Sequence
from pathlib import Path

import onnx
import torch
from onnx import TensorProto, helper, numpy_helper
from torch import Tensor, nn

from simbev_ros.errors import InputError

_MIN_HALVED = 256
"""Smaller constants keep their precision."""
_HALF = "_half"
_MODEL = "model."
"""Begins the names of all weights: that of the model within ``export.ExportedModel``."""


def halve_weights(graph: onnx.GraphProto) -> None:
    """Store large constants with half precision; a cast, which ONNX Runtime carries out once, restores their type."""
    casts = []
    for tensor in list(graph.initializer):
        values = numpy_helper.to_array(tensor)
        if tensor.data_type != TensorProto.FLOAT or values.size < _MIN_HALVED:
            continue
        half = f"{tensor.name}{_HALF}"
        graph.initializer.remove(tensor)
        graph.initializer.append(numpy_helper.from_array(values.astype("float16"), half))
        casts.append(helper.make_node("Cast", [half], [tensor.name], to=TensorProto.FLOAT))
    for cast in reversed(casts):
        graph.node.insert(0, cast)


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
        weights = _weights(file)
        fitting = {name: each for name, each in weights.items() if name in own and own[name].shape == each.shape}
        if not fitting:
            raise InputError(f"{file}: has no weights of this model; start_from takes what `simbev train` wrote")
        model.load_state_dict(fitting, strict=False)


def _weights(file: Path) -> dict[str, Tensor]:
    """Weights and statistics by their names in the model."""
    try:
        graph = onnx.load(str(file)).graph
    except Exception as error:  # a damaged file raises an error of protobuf, which onnx does not name
        raise InputError(f"{file}: cannot be read: {str(error).splitlines()[0]}") from None
    constants = {each.name.removesuffix(_HALF): numpy_helper.to_array(each) for each in graph.initializer}
    for node in graph.node:  # of equal weights, the export keeps one
        if node.op_type == "Identity" and node.input[0] in constants:
            constants[node.output[0]] = constants[node.input[0]]
    return {
        name.removeprefix(_MODEL): torch.from_numpy(values.astype("float32"))
        for name, values in constants.items()
        if values.dtype.kind == "f"
    }
