"""Turns cached samples into batches of tensors: decoded, augmented, and always the same for the same seed and epoch."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from simbev_ros.baselines.cache.reader import CachedScene
from simbev_ros.baselines.grid import HALF_M
from simbev_ros.baselines.modality import Modality
from simbev_ros.baselines.training.augmentation import Warp
from simbev_ros.baselines.training.config import Augmentation

_MAX_CENTER_M = HALF_M - 1e-3
"""Centers are on the grid, whatever is rounded later."""


class Batch(NamedTuple):
    """A batch of B samples.

    Attributes:
        points: (N, 4) float32 x, y, z (m, level frame), index of the sweep.
        sample: (N,) int64 index of each point's sample.
        images: (B, K, H, W, 3) uint8 RGB.
        gain: (B, 2) float32 contrast and brightness (0 … 255) that are applied to images.
        pixel_from_level: (B, K, 3, 4) float32.
        depth_m: (B, K, H / 8, W / 8) float32; 0: unknown.
        cells: (B, CELLS, CELLS) int32 grid as recorded, before the warp.
        level_from_warped: (B, 2, 2) float32 inverse of the warp of x and y.
        boxes: (M, 11) float32 boxes on the grid that have points: index of the sample, class, x, y, z, length, width,
            height, yaw, vx, vy.
    """

    points: Tensor
    sample: Tensor
    images: Tensor
    gain: Tensor
    pixel_from_level: Tensor
    depth_m: Tensor
    cells: Tensor
    level_from_warped: Tensor
    boxes: Tensor

    def to(self, device: torch.device) -> "Batch":
        """Copy to a device."""
        return Batch(*(each.to(device, non_blocking=True) for each in self))

    def pin_memory(self) -> "Batch":
        """Copy to memory from which copies to a GPU are asynchronous."""
        return Batch(*(each.pin_memory() for each in self))


class CachedBatches(Dataset[Batch]):
    """The batch of each step of a run: steps count through all epochs.

    Args:
        scenes: Scenes of the cache.
        modality: What the model sees; the rest is not read.
        batch_size: Samples in a batch; what is left over at the end of an epoch is left out.
        augmentation: Random changes; None: none, and the order is that of the scenes.
        seed: Seed of order and augmentation.

    Attributes:
        steps_per_epoch: Number of batches in an epoch.
    """

    def __init__(
        self,
        scenes: Sequence[CachedScene],
        modality: Modality,
        batch_size: int,
        augmentation: Augmentation | None,
        seed: int,
    ) -> None:
        self._scenes, self._modality, self._batch_size = list(scenes), modality, batch_size
        self._augmentation, self._seed = augmentation, seed
        self._samples = [(scene, frame) for scene in range(len(scenes)) for frame in range(len(scenes[scene].frames))]

        self.steps_per_epoch = len(self._samples) // batch_size

    def __getitem__(self, step: int) -> Batch:
        epoch, index = divmod(step, self.steps_per_epoch)
        order = np.arange(len(self._samples))
        if self._augmentation is not None:
            order = np.random.default_rng([self._seed, epoch]).permutation(len(order))
        chosen = order[index * self._batch_size : (index + 1) * self._batch_size]
        return self._collate([self._sample(int(each), epoch) for each in chosen])

    def _sample(self, number: int, epoch: int) -> dict[str, Tensor]:
        scene, frame = self._samples[number]
        sample = self._scenes[scene].sample(frame)
        rng = np.random.default_rng([self._seed, epoch, number])
        warp, gain = Warp(np.eye(2), 1.0), (1.0, 0.0)
        if self._augmentation is not None:
            warp, amount = Warp.draw(self._augmentation, rng), self._augmentation.brightness
            gain = (rng.uniform(1 - amount, 1 + amount), 128.0 * rng.uniform(-amount, amount))
        boxes = warp.boxes(sample.boxes[sample.boxes["points"] > 0])
        boxes = boxes[np.maximum(np.abs(boxes["x"]), np.abs(boxes["y"])) < _MAX_CENTER_M]
        names = ("class", "x", "y", "z", "length", "width", "height", "yaw", "vx", "vy")
        points = warp.points(sample.points) if self._modality.has_lidar else np.zeros((0, 4), np.float32)
        images = sample.images() if self._modality.has_cameras else np.zeros((0, 0, 0, 3), np.uint8)
        depth_m = sample.depth_m if self._modality.has_cameras else np.zeros((0, 0, 0), np.float32)
        return {
            "points": torch.from_numpy(points),
            "images": torch.from_numpy(images),
            "gain": torch.tensor(gain, dtype=torch.float32),
            "pixel_from_level": torch.from_numpy(warp.projections(sample.pixel_from_level)),
            "depth_m": torch.from_numpy(depth_m),
            "cells": torch.from_numpy(sample.cells.astype(np.int32)),
            "level_from_warped": torch.from_numpy(np.linalg.inv(warp.matrix).astype(np.float32)),
            "boxes": torch.from_numpy(np.stack([boxes[name].astype(np.float32) for name in names], 1)),
        }

    def _collate(self, samples: list[dict[str, Tensor]]) -> Batch:
        counts = torch.tensor([len(each["points"]) for each in samples])
        boxes = [torch.nn.functional.pad(each["boxes"], (1, 0), value=k) for k, each in enumerate(samples)]
        stacked = {
            name: torch.stack([each[name] for each in samples])
            for name in ("images", "gain", "pixel_from_level", "depth_m", "cells", "level_from_warped")
        }
        return Batch(
            points=torch.cat([each["points"] for each in samples]),
            sample=torch.repeat_interleave(torch.arange(len(samples)), counts),
            boxes=torch.cat(boxes),
            **stacked,
        )
