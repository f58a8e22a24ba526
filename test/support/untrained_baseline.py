"""Small stand-ins for trained baselines: the real networks with weights that nothing has trained. Needs torch."""

from pathlib import Path
from typing import Any

import torch

from simbev_ros.baselines.modality import Modality
from simbev_training.model.bev_model import BevModel
from simbev_training.training.export import export_model

CAMERAS, SIZE_PX = 2, (96, 64)


def export_untrained(path: Path, modality: Modality, about: dict[str, Any] | None = None) -> Path:
    """Write an untrained model that takes two small images, if it takes any, and says so, or something else."""
    torch.manual_seed(0)
    about = about or {"modality": modality.value, "sweep_ages_s": [0.0, 0.25, 0.5]}
    export_model(BevModel(modality), path, about, CAMERAS, SIZE_PX)
    return path
