"""Reads a cache as a list of samples; arrays stay on disk until a sample needs them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import simplejpeg

from simbev_ros.baselines.frames import points_of_frame, projections, sweeps_of_frame
from simbev_ros.baselines.grid import CELLS
from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.types import AnyArray, Float32Array, Float64Array, Table, UInt8Array
from simbev_training.cache.layout import CM_PER_M, FORMAT, KINDS, SCENE_FILE


@dataclass(frozen=True, eq=False)
class Sample:
    """One key frame.

    Attributes:
        sweeps_cm: (N, 3) int16 points of each of the frame's sweeps, cm, ego frame of its stamp; None: no such sweep.
        sweep_poses: (4, 4) pose of the ego at the stamp of each sweep.
        jpegs: Images of the cameras, as JPEG.
        pixel_from_level: (K, 3, 4) float32 projections.
        depth_m: (K, H / 8, W / 8) float32 depth; 0: none.
        cells: (CELLS, CELLS) uint16 grid.
        boxes: (B,) ``BOX_DTYPE``.
        lidar_m: (3,) position of the lidar in the ego frame.
        ring_deg: Angle between two of its rings; 0 if it is not always the same.
    """

    sweeps_cm: tuple[AnyArray | None, ...]
    sweep_poses: tuple[Float64Array | None, ...]
    jpegs: tuple[AnyArray, ...]
    pixel_from_level: Float32Array
    depth_m: Float32Array
    cells: AnyArray
    boxes: Table
    lidar_m: Float64Array
    ring_deg: float

    def points(self) -> Float32Array:
        """(N, 4) points as from ``points_of_frame``."""
        in_m = np.float32(CM_PER_M)
        sweeps = [None if each is None else each.astype(np.float32) / in_m for each in self.sweeps_cm]
        return points_of_frame(sweeps, self.sweep_poses)

    def images(self) -> UInt8Array:
        """(K, H, W, 3) decoded images, RGB. Raises InputError if one is damaged."""
        with foreign_content("an image of the cache"):
            return np.stack([simplejpeg.decode_jpeg(bytes(each), colorspace="RGB") for each in self.jpegs])


class CachedScene:
    """A scene of a cache. It is small when it is sent to another process, which maps the files again."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @cached_property
    def about(self) -> dict[str, Any]:
        """Facts about the scene.

        Raises:
            InputError: The scene is damaged, or of another version.
        """
        path = self.folder / SCENE_FILE
        with foreign_content(path):
            about: dict[str, Any] = parse_json(path.read_bytes())
            if about.get("format") != FORMAT:
                raise InputError(
                    f"{path}: format: {about.get('format')!r:.80}; this version reads {FORMAT}; write the cache again"
                )
            _ = [about[name] for name in ("name", "cameras", "width_px", "height_px")], float(about["ring_deg"])
            if np.shape(about["lidar_m"]) != (3,) or not np.isfinite(np.array(about["lidar_m"], np.float64)).all():
                raise ValueError("lidar_m must be three numbers")
        return about

    @cached_property
    def frames(self) -> Table:
        """(F,) ``FRAME_DTYPE``."""
        return np.asarray(self._map("frames"))

    @property
    def boxes(self) -> Table:
        """(B,) ``BOX_DTYPE`` boxes of all frames."""
        return np.asarray(self._arrays["boxes"])

    @cached_property
    def _arrays(self) -> dict[str, AnyArray]:
        arrays = {name: self._map(name) for name in KINDS if name != "frames"} | {"frames": self.frames}
        with foreign_content(self.folder):
            _require_consistent(arrays)
        return arrays

    def __getstate__(self) -> dict[str, Any]:
        return {"folder": self.folder}

    def sample(self, index: int, sweep_ages_ns: Sequence[int]) -> Sample:
        """A key frame with the sweeps of some ages, newest first. Raises InputError if the scene is damaged."""
        frame, arrays = self.frames[index], self._arrays
        with foreign_content(self.folder):
            sweeps = sweeps_of_frame(int(frame["stamp_ns"]), arrays["sweeps"]["stamp_ns"], sweep_ages_ns)
        ends = arrays["image_ends"].ravel()
        cameras = arrays["image_ends"].shape[1]
        first = index * cameras
        starts = [0 if k == 0 else int(ends[k - 1]) for k in range(first, first + cameras)]
        boxes = slice(int(self.frames["boxes_end"][index - 1]) if index else 0, int(frame["boxes_end"]))
        return Sample(
            sweeps_cm=tuple(self._points_cm(each) if each >= 0 else None for each in sweeps),
            sweep_poses=tuple(arrays["sweeps"]["map_from_ego"][each] if each >= 0 else None for each in sweeps),
            jpegs=tuple(arrays["images"][s : int(ends[first + k])] for k, s in enumerate(starts)),
            pixel_from_level=projections(arrays["pixels"], frame["map_from_ego"]),
            depth_m=arrays["depth"][index].astype(np.float32) / np.float32(CM_PER_M),
            cells=arrays["cells"][index],
            boxes=np.asarray(arrays["boxes"][boxes]),
            lidar_m=np.array(self.about["lidar_m"], np.float64),
            ring_deg=float(self.about["ring_deg"]),
        )

    def _points_cm(self, sweep: int) -> AnyArray:
        """(N, 3) points of a sweep."""
        ends = self._arrays["sweeps"]["points_end"]
        return self._arrays["points"][int(ends[sweep - 1]) if sweep else 0 : int(ends[sweep])]

    def _map(self, name: str) -> AnyArray:
        path = self.folder / f"{name}.npy"
        with foreign_content(path):
            array, (kind, axes) = np.asarray(np.load(path, mmap_mode="r")), KINDS[name]
            if array.dtype != kind or array.ndim < axes:
                raise ValueError(f"it has {array.ndim} axes of {array.dtype!s:.80}, not {axes} of {kind!s:.80}")
        return array


def cached_scenes(cache: Path, split: str) -> list[CachedScene]:
    """The scenes of a split by ascending number.

    Raises:
        InputError: There is none.
    """
    folders = [path.parent for path in (cache / split).glob(f"[!.]*/{SCENE_FILE}")]
    if not folders:
        raise InputError(f"{cache}: holds no scenes of the split {split}")
    with foreign_content(f"{cache / split}: names of scenes"):
        return [CachedScene(folder) for folder in sorted(folders, key=lambda each: int(each.name.rsplit("-", 1)[1]))]


def _require_consistent(arrays: Mapping[str, AnyArray]) -> None:
    """Raise ValueError if arrays have other lengths than those that refer to them say."""
    frames, cameras = len(arrays["frames"]), arrays["image_ends"].shape[1]
    shapes = {"image_ends": (frames, cameras), "depth": (frames,), "cells": (frames, CELLS, CELLS)}
    for name, shape in {**shapes, "pixels": (cameras, 3, 4), "points": (len(arrays["points"]), 3)}.items():
        if arrays[name].shape[: len(shape)] != shape:
            raise ValueError(f"{name} has the shape {arrays[name].shape}, not {shape}")
    ends = {"points": arrays["sweeps"]["points_end"], "images": arrays["image_ends"].ravel()}
    for name, end in {**ends, "boxes": arrays["frames"]["boxes_end"]}.items():
        if np.any(np.diff(end, prepend=0) < 0) or (end[-1] if len(end) else 0) != len(arrays[name]):
            raise ValueError(f"{name} has {len(arrays[name])} rows, which are not those that the frames refer to")
