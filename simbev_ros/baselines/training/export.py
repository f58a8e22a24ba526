"""Exports a trained model as ONNX, whole: from points and images to scores, with weights of half precision."""

import json
import warnings
from pathlib import Path
from typing import Any

import onnx
import torch
from onnx import helper
from torch import Tensor, nn
from torch.nn.functional import max_pool2d

from simbev_ros.baselines.cache.reader import cached_scenes
from simbev_ros.baselines.inference import ABOUT_KEY
from simbev_ros.baselines.model.bev_model import BevModel, Inputs
from simbev_ros.baselines.training.loop import CHECKPOINT_FILE, load_model
from simbev_ros.baselines.training.onnx_weights import halve_weights
from simbev_ros.recording.whole_files import write_whole

MODEL_FILE = "model.onnx"
_OPSET = 18


class ExportedModel(nn.Module):
    """A model for one frame as the ONNX file holds it: images as they come, scores of cells as bytes, peaks only."""

    def __init__(self, model: BevModel) -> None:
        super().__init__()
        self.model = model

    def forward(self, *given: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Cells (CELLS, CELLS, C) uint8, heat (classes, …), values (10, …) of points, images, projections."""
        rest = list(given)
        points = rest.pop(0) if self.model.modality.has_lidar else None
        images, projections = rest if self.model.modality.has_cameras else (None, None)
        outputs = self.model(
            Inputs(
                points=points,
                sample=None if points is None else torch.zeros_like(points[:, 0], dtype=torch.int64),
                images=None if images is None else images[None].permute(0, 1, 4, 2, 3).to(torch.float32),
                pixel_from_level=None if projections is None else projections[None],
                samples=1,
            )
        )
        heat = torch.sigmoid(outputs.heat)
        peaks = heat * (heat == max_pool2d(heat, 3, 1, 1))
        cells = (torch.sigmoid(outputs.cells[0]) * 255.0 + 0.5).to(torch.uint8).permute(1, 2, 0)
        return cells, peaks[0], outputs.boxes[0]


def export_model(model: BevModel, path: Path, about: dict[str, Any], cameras: int, size_px: tuple[int, int]) -> None:
    """Write a model as ONNX, atomically.

    Args:
        model: The model, on the CPU.
        path: The file.
        about: What it is, for the metadata; must hold ``modality`` and ``sweep_ages_s``.
        cameras: Number of images.
        size_px: Width and height of an image.
    """
    given, names, dynamic = [], [], {}
    if model.modality.has_lidar:
        given.append(torch.rand(1000, 4))
        names.append("points")
        dynamic["points"] = {0: "points"}
    if model.modality.has_cameras:
        width_px, height_px = size_px
        given += [torch.zeros(cameras, height_px, width_px, 3, dtype=torch.uint8), torch.rand(cameras, 3, 4)]
        names += ["images", "pixel_from_level"]
    making = path.with_suffix(".making")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.onnx.export(
            ExportedModel(model).eval(),
            tuple(given),
            str(making),
            input_names=names,
            output_names=["cells", "heat", "boxes"],
            dynamic_axes=dynamic,
            opset_version=_OPSET,
            do_constant_folding=False,
            dynamo=False,
        )
    exported = onnx.load(str(making))
    making.unlink()
    halve_weights(exported.graph)
    helper.set_model_props(exported, {ABOUT_KEY: json.dumps(about, sort_keys=True)})
    write_whole(path, exported.SerializeToString())


def export_run(run: Path, cache: Path) -> Path:
    """Export the checkpoint in a run's folder as ``model.onnx`` beside it; return its path.

    Raises:
        InputError: The checkpoint or the cache cannot be read.
    """
    training, model = load_model(run / CHECKPOINT_FILE)
    about = cached_scenes(cache, "train")[0].about
    path = run / MODEL_FILE
    size_px = int(about["width_px"]), int(about["height_px"])
    settings = training.model_dump(mode="json")
    description = {"modality": settings["modality"], "sweep_ages_s": settings["sweep_ages_s"], "training": settings}
    export_model(model, path, description, len(about["cameras"]), size_px)
    return path
