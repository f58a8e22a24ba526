"""Command of a baseline's node: the words that name its model."""

from pathlib import Path

from simbev_ros.baselines.inference import require_onnx_runtime
from simbev_ros.baselines.modality import Modality
from simbev_ros.baselines.model_file import require_model_file


def model_words(modality: str, weights: Path | None) -> tuple[str, ...]:
    """Arguments that name the model to run.

    Args:
        modality: Input of the baseline, a ``Modality``.
        weights: A file of the user's; None: the weights in the package.

    Raises:
        InputError: ONNX Runtime or the file is missing.
    """
    require_onnx_runtime()
    return modality, str(require_model_file(Modality(modality), weights).resolve())
