"""The file of a baseline's weights: that in the package or one of the user's, and what it takes to read it."""

from pathlib import Path

from simbev_ros.baselines.inference import Baseline, weights_file
from simbev_ros.baselines.modality import Modality
from simbev_ros.foundation.errors import InputError


def require_model_file(modality: Modality, path: Path | None) -> Path:
    """The file of a baseline, which exists.

    Args:
        modality: What the baseline sees.
        path: A file of the user's; None: the weights in the package.

    Raises:
        InputError: There is no such file.
    """
    if path is None:
        path = weights_file(modality)
        if not path.is_file():
            raise InputError(
                f"this package comes without weights for the {modality} baseline ({path.name}); give a file of your "
                "own, which `simbev train` writes"
            )
    if not path.is_file():
        raise InputError(
            f"{path}: there is no such file; baseline-{modality} needs an ONNX file that `simbev train` wrote"
        )
    return path


def model_file(name: str) -> Path:
    """An existing file of a model: the one in the package if the name is camera, lidar or fused.

    Raises:
        InputError: There is no such file.
    """
    if name in list(Modality):
        return require_model_file(Modality(name), None)
    if not Path(name).is_file():
        raise InputError(f"{name}: no such file; give an ONNX file that `simbev train` wrote, or {', '.join(Modality)}")
    return Path(name)


def load_baseline(modality: Modality, path: Path | None) -> Baseline:
    """Load a baseline.

    Args:
        modality: What it sees.
        path: A file of the user's; None: the weights in the package.

    Raises:
        InputError: There is no such file, it cannot be read, or it is another baseline.
    """
    path = require_model_file(modality, path)
    baseline = Baseline(path)
    if baseline.modality is not modality:
        raise InputError(f"{path}: is a {baseline.modality} model, which baseline-{baseline.modality} runs")
    return baseline
