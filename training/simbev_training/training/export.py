"""Exports a trained model as ONNX, whole, from points and images to scores: alone, or as an ensemble with others."""

import json
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import onnx
import torch
from onnx import helper
from torch import Tensor, nn
from torch.nn.functional import max_pool2d

from simbev_ros.baselines.inference import ABOUT_KEY
from simbev_ros.baselines.model_file import model_file
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.whole_files import write_whole
from simbev_training.cache.reader import cached_scenes
from simbev_training.model.bev_model import BevModel, Inputs
from simbev_training.training.config import Training
from simbev_training.training.loop import CHECKPOINT_FILE, load_model
from simbev_training.training.onnx_weights import read_model, shrink_weights

MODEL_FILE = "model.onnx"
_OPSET = 18


class ExportedModel(nn.Module):
    """A model for one frame as the ONNX file holds it: images as they come, scores of cells as bytes, peaks only.

    Args:
        model: The model.
        others: Models whose answers are averaged with its own; what they compute alike, ONNX Runtime computes once.
    """

    def __init__(self, model: BevModel, others: Sequence[BevModel] = ()) -> None:
        super().__init__()
        self.model = model
        self.others = nn.ModuleList(others)

    def forward(self, *given: Tensor) -> tuple[Tensor, ...]:
        """Cells (CELLS, CELLS, C) uint8, then heat (classes, …) and values (10, …) of large and of small objects.

        What is given are points, images and projections.
        """
        rest = list(given)
        points = rest.pop(0) if self.model.modality.has_lidar else None
        images, projections = rest if self.model.modality.has_cameras else (None, None)
        inputs = Inputs(
            points=points,
            sample=None if points is None else torch.zeros_like(points[:, 0], dtype=torch.int64),
            images=None if images is None else images[None].permute(0, 1, 4, 2, 3).to(torch.float32),
            pixel_from_level=None if projections is None else projections[None],
            samples=1,
        )
        answers = [model(inputs) for model in (self.model, *self.others)]
        scores = torch.sigmoid(_mean([each.cells for each in answers])[0])
        cells = (scores * 255.0 + 0.5).to(torch.uint8).permute(1, 2, 0)
        large = _peaks([each.heat for each in answers]), _mean([each.boxes for each in answers])[0]
        small = _peaks([each.small_heat for each in answers]), _mean([each.small_boxes for each in answers])[0]
        return cells, *large, *small


def export_model(
    model: BevModel,
    path: Path,
    about: dict[str, Any],
    cameras: int,
    size_px: tuple[int, int],
    *,
    others: Sequence[BevModel] = (),
    weights: Literal["half", "int8"] = "half",
) -> None:
    """Write a model as ONNX, atomically.

    Args:
        model: The model, on the CPU.
        path: The file.
        about: What it is, for the metadata; must hold ``modality`` and ``sweep_ages_s``.
        cameras: Number of images.
        size_px: Width and height of an image.
        others: Models whose answers are averaged with its own, on the CPU.
        weights: As for ``shrink_weights``.
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
            ExportedModel(model, others).eval(),
            tuple(given),
            str(making),
            input_names=names,
            output_names=["cells", "heat", "boxes", "small_heat", "small_boxes"],
            dynamic_axes=dynamic,
            opset_version=_OPSET,
            do_constant_folding=False,
            dynamo=False,
        )
    exported = onnx.load(str(making))
    making.unlink()
    shrink_weights(exported.graph, weights)
    helper.set_model_props(exported, {ABOUT_KEY: json.dumps(about, sort_keys=True)})
    write_whole(path, exported.SerializeToString())


def export_run(training: Training, run: Path, cache: Path) -> Path:
    """Export the checkpoint in a run's folder as ``model.onnx`` next to it; return its path.

    Args:
        training: The run's configuration.
        run: The folder.
        cache: Cache of the dataset.

    Raises:
        InputError: The checkpoint, the cache or a model to average with cannot be read, or does not suit the run.
    """
    _, model = load_model(run / CHECKPOINT_FILE)
    others = models_to_average(training)
    about = cached_scenes(cache, "train")[0].about
    path = run / MODEL_FILE
    size_px = int(about["width_px"]), int(about["height_px"])
    settings = training.model_dump(mode="json")
    description = {"modality": settings["modality"], "sweep_ages_s": settings["sweep_ages_s"], "training": settings}
    export_model(
        model, path, description, len(about["cameras"]), size_px, others=others, weights=training.export_weights
    )
    return path


def models_to_average(training: Training) -> list[BevModel]:
    """Models whose answers a run's exported model averages with its own.

    Raises:
        InputError: One of them cannot be read, or sees what the run's model does not.
    """
    models = []
    for name in training.average_with:
        try:
            file = model_file(name)
            model, about = read_model(file)
        except InputError as error:
            raise InputError(f"average_with: {error}") from None
        seen, see = model.modality, training.modality
        if (seen.has_lidar and not see.has_lidar) or (seen.has_cameras and not see.has_cameras):
            raise InputError(f"average_with: {file}: is a {seen} model; a {see} model does not see all that it needs")
        if seen.has_lidar and about["sweep_ages_s"] != list(training.sweep_ages_s):
            raise InputError(
                f"average_with: {file}: takes sweeps of {about['sweep_ages_s']} s; sweep_ages_s is "
                f"{list(training.sweep_ages_s)}"
            )
        models.append(model)
    return models


def _peaks(logits: Sequence[Tensor]) -> Tensor:
    """(classes, …) mean scores of one frame, 0 where a neighbor has a higher one."""
    heat = torch.sigmoid(_mean(logits))
    peaks: Tensor = heat * (heat == max_pool2d(heat, 3, 1, 1))
    return peaks[0]


def _mean(values: Sequence[Tensor]) -> Tensor:
    return values[0] if len(values) == 1 else torch.stack(list(values)).mean(0)
