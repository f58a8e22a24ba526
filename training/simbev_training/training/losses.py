"""Losses of both heads and of the depth of images."""

import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, cross_entropy, logsigmoid

from simbev_ros.baselines.boxes import BOX_VALUES
from simbev_training.model.cameras import DEPTHS, FAR_M, NEAR_M, depth_index
from simbev_training.model.heads import Outputs
from simbev_training.training.targets import BoxTargets, Targets

_MIN_SHARE = 1e-4
_BOX_WEIGHT, _DEPTH_WEIGHT = 0.25, 0.5
_OFFSETS = 2
"""The first values of a box, its position within the cell, which count twice."""


def losses_of(outputs: Outputs, targets: Targets, depth_m: Tensor | None) -> dict[str, Tensor]:
    """Losses of a batch by name, to be added up; ``depth_m`` is that of the images, if the model sees any."""
    losses = {
        **_cell_losses(outputs.cells.float().permute(0, 2, 3, 1), targets.cells, targets.known),
        "heat": _heat_loss(outputs.heat.float(), targets.large),
        "boxes": _BOX_WEIGHT * _box_loss(outputs.boxes.float(), targets.large),
        "small_heat": _heat_loss(outputs.small_heat.float(), targets.small),
        "small_boxes": _BOX_WEIGHT * _box_loss(outputs.small_boxes.float(), targets.small),
    }
    if outputs.depth is not None and depth_m is not None:
        losses["depth"] = _DEPTH_WEIGHT * _depth_loss(outputs.depth, depth_m)
    return losses


def _cell_losses(logits: Tensor, cells: Tensor, known: Tensor) -> dict[str, Tensor]:
    """Cross entropy, with more weight for rare classes, and the Dice loss of each class over the batch.

    The Dice loss (https://arxiv.org/abs/1606.04797) stands in for the IoU that is measured: with cross entropy alone,
    classes with few and small objects hardly reach a score of one half.
    """
    over_cells = (0, 1, 2)
    share = ((cells * known).mean(over_cells) / known.mean()).clamp(min=_MIN_SHARE)
    entropy = binary_cross_entropy_with_logits(logits, cells, reduction="none") * known
    scores = torch.sigmoid(logits) * known
    both = (scores * cells).sum(over_cells)
    dice = 1.0 - (2.0 * both + 1.0) / (scores.sum(over_cells) + (cells * known).sum(over_cells) + 1.0)
    return {"cells": (entropy.mean(over_cells) / share.sqrt()).mean(), "dice": dice.mean()}


def _heat_loss(logits: Tensor, targets: BoxTargets) -> Tensor:
    """Focal loss of heat maps with reduced penalty near centers (https://arxiv.org/abs/1904.07850)."""
    heat, score = targets.heat, torch.sigmoid(logits)
    is_center = heat >= 1.0
    positive = -logsigmoid(logits) * (1.0 - score) ** 2
    negative = -logsigmoid(-logits) * score**2 * (1.0 - torch.maximum(heat, targets.open)) ** 4
    return torch.where(is_center, positive, negative).sum() / is_center.sum().clamp(min=1)


def _box_loss(values: Tensor, targets: BoxTargets) -> Tensor:
    """Weighted absolute errors at the centers."""
    predicted = values.permute(0, 2, 3, 1).reshape(-1, len(BOX_VALUES))[targets.center]
    errors = (predicted - targets.boxes).abs() * targets.weight[:, None]
    return (errors.sum() + errors[:, :_OFFSETS].sum()) / targets.weight.sum().clamp(min=1)


def _depth_loss(logits: Tensor, depth_m: Tensor) -> Tensor:
    """Cross entropy of the interval of depth, where there is a depth within the intervals."""
    known = (depth_m > NEAR_M) & (depth_m < FAR_M)
    interval = torch.where(known, depth_index(depth_m).floor().clamp(0, DEPTHS - 1), -1.0).long()
    loss = cross_entropy(logits.flatten(0, 1).float(), interval.flatten(0, 1), ignore_index=-1, reduction="sum")
    return loss / known.sum().clamp(min=1)
