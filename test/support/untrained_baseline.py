"""Small stand-ins for trained baselines: the real networks with weights that nothing has trained. Needs torch."""

from pathlib import Path

import torch

from simbev_ros.baselines.modality import Modality
from simbev_ros.baselines.model.bev_model import BevModel
from simbev_ros.baselines.training.export import export_model

CAMERAS, SIZE_PX = 2, (96, 64)


def export_untrained(path: Path, modality: Modality) -> Path:
    """Write an untrained model that takes two small images, if it takes any."""
    torch.manual_seed(0)
    export_model(BevModel(modality), path, {"modality": modality.value}, CAMERAS, SIZE_PX)
    return path
