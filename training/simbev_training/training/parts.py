"""Cuts a lidar baseline's ONNX file in two at the features of the grid's cells, which agents can exchange there."""

from pathlib import Path

import onnx
from onnx.utils import Extractor

from simbev_ros.foundation.errors import InputError
from simbev_training.training.onnx_weights import load_model_file

_CELL_FEATURES = "/model/lidar/fine/fine.2/Relu_output_0"
"""What ``PillarEncoder.fine`` gives: all that a model of ``export.ExportedModel`` knows of the points."""


def cut_model(file: Path) -> tuple[bytes, bytes]:
    """ONNX models of the part up to the features of cells, and of the part behind them.

    Each has one input: the first one ``points``, the second one the output of the first.

    Args:
        file: ONNX file of a lidar baseline.

    Raises:
        InputError: The file cannot be read, or is not a lidar baseline alone, without an ensemble.
    """
    whole = load_model_file(file)
    made = {name: index for index, node in enumerate(whole.graph.node) for name in node.output}
    is_ensemble = any(each.name.startswith("others.") for each in whole.graph.initializer)
    if [each.name for each in whole.graph.input] != ["points"] or _CELL_FEATURES not in made or is_ensemble:
        raise InputError(f"{file}: is not a single lidar model that `simbev train` wrote, so it cannot be cut")
    extractor = Extractor(onnx.shape_inference.infer_shapes(whole))
    last = extractor.extract_model([_CELL_FEATURES], [each.name for each in whole.graph.output])
    # The first part has subgraphs, in which the extractor does not look; but nodes are sorted.
    features = next(each for each in last.graph.input if each.name == _CELL_FEATURES)
    del whole.graph.node[made[_CELL_FEATURES] + 1 :], whole.graph.output[:]
    whole.graph.output.append(features)
    return whole.SerializeToString(), last.SerializeToString()
