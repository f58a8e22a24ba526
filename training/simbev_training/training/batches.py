"""Turns cached samples into batches of tensors: decoded, augmented, and always the same for the same seed and epoch."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from simbev_ros.baselines.frames import sweep_ages_ns
from simbev_ros.baselines.grid import HALF_M, level_from_map
from simbev_ros.foundation.types import Float32Array, Float64Array
from simbev_training.cache.layout import CM_PER_M
from simbev_training.cache.reader import CachedScene, Sample
from simbev_training.training.augmentation import Thinning, Warp
from simbev_training.training.config import Training
from simbev_training.training.image_pasting import Images, paste_images
from simbev_training.training.image_warps import draw_image_warps, unit_from_pixel, warped_images
from simbev_training.training.pasting import frames_with_rare_objects, paste

_MAX_CENTER_M = HALF_M - 1e-3
"""Centers are on the grid, whatever is rounded later."""


class Batch(NamedTuple):
    """A batch of B samples.

    Attributes:
        points_cm: (N, 3) int16 points of all sweeps, cm, in the ego frame of their stamp.
        points_of_sweep: (B, sweeps) int64 number of points of each sweep; points come in this order.
        warped_from_sweep: (B, sweeps, 3, 4) float32 transforms from the sweeps' ego frames to the warped level frame.
        images: (B, K, H, W, 3) uint8 RGB.
        gain: (B, 2) float32 contrast and brightness (0 … 255) that are applied to images.
        recorded_from_warped: (B, K, 3, 3) float32 maps from warped to recorded images, as for ``warped_images``.
        pixel_from_level: (B, K, 3, 4) float32 projections to the warped images.
        depth_m: (B, K, H / 8, W / 8) float32, as recorded; 0: unknown.
        cells: (B, CELLS, CELLS) int32 grid as recorded, before the warp.
        level_from_warped: (B, 2, 3) float32 inverse of the warp of x and y, with its translation.
        boxes: (M, 12) float32 boxes on the grid that have points: index of the sample, class, x, y, z, length, width,
            height, yaw, vx, vy, and 1 if they have enough points to be learned, else 0.
    """

    points_cm: Tensor
    points_of_sweep: Tensor
    warped_from_sweep: Tensor
    images: Tensor
    gain: Tensor
    recorded_from_warped: Tensor
    pixel_from_level: Tensor
    depth_m: Tensor
    cells: Tensor
    level_from_warped: Tensor
    boxes: Tensor

    def to(self, device: torch.device) -> "Batch":
        """Copy to a device."""
        return Batch(*(each.to(device, non_blocking=True) for each in self))

    def points(self) -> tuple[Tensor, Tensor]:
        """(N, 4) float32 x, y, z (m, warped level frame) and index of the sweep, and (N,) int64 index of the sample.

        Transforming points here instead of when a batch is made leaves that to the GPU.
        """
        parts = torch.arange(self.points_of_sweep.numel(), device=self.points_cm.device)
        # With the size given, a GPU need not be waited for.
        part = parts.repeat_interleave(self.points_of_sweep.flatten(), output_size=len(self.points_cm))
        x, y, z = (self.points_cm.t().contiguous().float() / CM_PER_M).unbind()
        rows = self.warped_from_sweep.flatten(0, 1).permute(1, 2, 0)
        moved = [a[part] * x + b[part] * y + c[part] * z + d[part] for a, b, c, d in rows]
        sweeps = self.warped_from_sweep.shape[1]
        # Each coordinate lies in one piece, which makes the many steps from here to pillars faster.
        return torch.stack([*moved, (part % sweeps).float()]).t(), part // sweeps

    def pixels(self) -> Tensor:
        """(B, K, 3, H, W) float32 RGB of the warped images, 0 … 255, with other contrast and brightness."""
        recorded = self.images.permute(0, 1, 4, 2, 3).to(torch.float32)
        warped = warped_images(recorded, self.recorded_from_warped, "bilinear")
        gain = self.gain[:, :, None, None, None, None]
        return ((warped - 128.0) * gain[:, 0] + 128.0 + gain[:, 1]).clamp(0, 255)

    def pixel_depth_m(self) -> Tensor:
        """(B, K, H / 8, W / 8) float32 depth of the warped images; 0: unknown."""
        return warped_images(self.depth_m[:, :, None], self.recorded_from_warped, "nearest")[:, :, 0]

    def pin_memory(self) -> "Batch":
        """Copy to memory from which copies to a GPU are asynchronous."""
        return Batch(*(each.pin_memory() for each in self))


class CachedBatches(Dataset[Batch]):
    """The batch of each step of a run: steps count through all epochs.

    Args:
        scenes: Scenes of the cache.
        training: Size of batches, sweeps, augmentation and seed.
        augmented: Whether samples are changed and come in random order; else the order is that of the scenes.

    Attributes:
        steps_per_epoch: Number of batches in an epoch.
    """

    def __init__(self, scenes: Sequence[CachedScene], training: Training, *, augmented: bool = True) -> None:
        self._scenes, self._modality, self._batch_size = list(scenes), training.modality, training.batch_size
        self._augmentation, self._seed = training.augmentation if augmented else None, training.seed
        # Without a lidar, the newest sweep shows where the ground is, on which objects are pasted.
        self._sweep_ages_s = training.sweep_ages_s if training.modality.has_lidar else training.sweep_ages_s[:1]
        self._min_points = training.min_points
        self._sweep_ages_ns = sweep_ages_ns(self._sweep_ages_s)
        self._samples = [(scene, frame) for scene in range(len(scenes)) for frame in range(len(scenes[scene].frames))]
        self._donors = frames_with_rare_objects(scenes) if augmented and training.augmentation.pasting > 0 else []
        self.steps_per_epoch = len(self._samples) // training.batch_size

    def __getitem__(self, step: int) -> Batch:
        epoch, index = divmod(step, self.steps_per_epoch)
        order = np.arange(len(self._samples))
        if self._augmentation is not None:
            order = np.random.default_rng([self._seed, epoch]).permutation(len(order))
        chosen = order[index * self._batch_size : (index + 1) * self._batch_size]
        return self._collate([self._sample(int(each), epoch) for each in chosen])

    def _sample(self, number: int, epoch: int) -> dict[str, Tensor]:
        scene, frame = self._samples[number]
        sample = self._scenes[scene].sample(frame, self._sweep_ages_ns)
        images = self._images(sample)
        rng = np.random.default_rng([self._seed, epoch, number])
        warp, gain, thinning = Warp(np.eye(2), 1.0), (1.0, 0.0), Thinning(0.0, False, 0.0)
        if self._augmentation is not None:
            warp, amount = Warp.draw(self._augmentation, rng), self._augmentation.brightness
            gain = (rng.uniform(1 - amount, 1 + amount), 128.0 * rng.uniform(-amount, amount))
            thinning = Thinning.draw(self._augmentation, rng)
            if self._donors and rng.random() < self._augmentation.pasting:
                sample, images = self._with_pasted(sample, images, rng)
            if self._augmentation.missing_cameras and rng.random() < self._augmentation.missing_cameras:
                images = images.without(rng.random(len(images.rgb)) < 0.5)
        boxes = warp.boxes(sample.boxes[sample.boxes["points"] > 0])
        boxes = boxes[np.maximum(np.abs(boxes["x"]), np.abs(boxes["y"])) < _MAX_CENTER_M]
        names = ("class", "x", "y", "z", "length", "width", "height", "yaw", "vx", "vy")
        columns = [*(boxes[name] for name in names), boxes["points"] >= self._min_points]
        sweeps = [np.zeros((0, 3), np.int16) for _ in sample.sweeps_cm]
        if self._modality.has_lidar:
            sweeps = thinning.sweeps(sample, rng)
        size_px = images.rgb.shape[2], images.rgb.shape[1]
        image_warps = np.tile(np.eye(3), (len(images.rgb), 1, 1))
        if self._augmentation is not None:
            image_warps = draw_image_warps(self._augmentation, len(images.rgb), size_px, rng)
        unit = unit_from_pixel(size_px)
        projections = (image_warps @ warp.projections(images.pixel_from_level)).astype(np.float32)
        return {
            "points_cm": torch.from_numpy(np.concatenate(sweeps)),
            "points_of_sweep": torch.tensor([len(each) for each in sweeps]),
            "warped_from_sweep": torch.from_numpy(_transforms(warp, sample.sweep_poses)),
            "images": torch.from_numpy(images.rgb),
            "gain": torch.tensor(gain, dtype=torch.float32),
            "recorded_from_warped": torch.from_numpy((unit @ np.linalg.inv(unit @ image_warps)).astype(np.float32)),
            "pixel_from_level": torch.from_numpy(projections),
            "depth_m": torch.from_numpy(images.depth_m),
            "cells": torch.from_numpy(sample.cells.astype(np.int32)),
            "level_from_warped": torch.from_numpy(warp.level_from_warped),
            "boxes": torch.from_numpy(np.stack([each.astype(np.float32) for each in columns], 1)),
        }

    def _images(self, sample: Sample) -> Images:
        """The images of a sample; none if the model sees none."""
        if self._modality.has_cameras:
            return Images(sample.images(), sample.depth_m, sample.pixel_from_level)
        nothing = np.zeros((0, 1, 1), np.float32)
        return Images(np.zeros((0, 1, 1, 3), np.uint8), nothing, np.zeros((0, 3, 4), np.float32))

    def _with_pasted(self, sample: Sample, images: Images, rng: np.random.Generator) -> tuple[Sample, Images]:
        """A sample and its images with rare objects of another."""
        scene, frame = self._donors[rng.integers(len(self._donors))]
        donor = self._scenes[scene].sample(frame, self._sweep_ages_ns)
        pasted = paste(sample, donor, self._sweep_ages_s)
        if len(images.rgb) and len(pasted.boxes):
            images = paste_images(images, self._images(donor), pasted.boxes, pasted.steps_m)
        return pasted.sample, images

    def _collate(self, samples: list[dict[str, Tensor]]) -> Batch:
        boxes = [torch.nn.functional.pad(each["boxes"], (1, 0), value=k) for k, each in enumerate(samples)]
        apart = ("points_cm", "boxes")
        stacked = {name: torch.stack([each[name] for each in samples]) for name in samples[0] if name not in apart}
        return Batch(
            points_cm=torch.cat([each["points_cm"] for each in samples]),
            boxes=torch.cat(boxes),
            **stacked,
        )


def _transforms(warp: Warp, poses: Sequence[Float64Array | None]) -> Float32Array:
    """(sweeps, 3, 4) transforms from the ego frames of sweeps, newest first, to the warped level frame; 0: no sweep."""
    newest = poses[0]
    assert newest is not None
    warped_from_map = warp.warped_from_level @ level_from_map(newest)
    return np.array([np.zeros((3, 4)) if pose is None else (warped_from_map @ pose)[:3] for pose in poses], np.float32)
