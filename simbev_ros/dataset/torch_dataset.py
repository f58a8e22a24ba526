"""Frames as a torch ``Dataset``. The only module that imports torch, which is no requirement of this package.

::

    from torch.utils.data import DataLoader

    frames = open_dataset("datasets/first").frames(split="train", keys=["cam_front/rgb", "lidar/points", "boxes"])
    data = FrameDataset(frames, ["cam_front/rgb", "lidar/points", "boxes"], {"lidar/points": ["x", "y", "z"]})
    for batch in DataLoader(data, batch_size=4, shuffle=True, num_workers=2, collate_fn=data.collate):
        batch["cam_front/rgb"]      # (4, H, W, 3) uint8
        batch["lidar/points"]       # four tensors (N, 3) float32
        batch["boxes"]              # four dicts of columns, each (M,)
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch.utils.data import Dataset, get_worker_info

from simbev_ros.dataset.frame import Frame
from simbev_ros.dataset.values import columns
from simbev_ros.types import AnyArray

Sample = dict[str, Any]

_WIDER = {"uint16": np.int32, "uint32": np.int64, "uint64": np.int64}
"""What torch computes with in the place of types that it hardly knows."""


class FrameDataset(Dataset[Sample]):
    """Samples are dicts: of each key its value, and ``map_from_ego``, ``scene``, ``tick``, ``stamp_ns``.

    Images are tensors as the arrays are, (H, W) or (H, W, C); uint16 becomes int32, uint32 int64. Of clouds and other
    tables a sample has a dict of columns, or one (N, K) tensor of the columns that were named.
    """

    def __init__(
        self,
        frames: Sequence[Frame],
        keys: Collection[str],
        columns_of: Mapping[str, Sequence[str]] | None = None,
        transform: Callable[[Sample], Sample] | None = None,
    ) -> None:
        """Takes frames, as of ``Dataset.frames``, which must have the keys that samples are to have.

        Args:
            frames: The frames.
            keys: What a sample is to have.
            columns_of: Of tables, by key: the columns that are to make one tensor.
            transform: Is given each sample, and gives what is to be used in its place.
        """
        self.frames, self.keys = frames, tuple(keys)
        self.columns_of, self.transform = dict(columns_of or {}), transform

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, index: int) -> Sample:
        frame = self.frames[index]
        if get_worker_info() is None:
            frame.load(self.keys)  # in threads; the workers of a loader are as many as the cores already
        sample = {key: self._tensors(key, frame[key]) for key in self.keys}
        sample["map_from_ego"] = torch.from_numpy(frame.map_from_ego)
        sample.update(scene=frame.scene.name, tick=frame.tick, stamp_ns=frame.stamp_ns)
        return sample if self.transform is None else self.transform(sample)

    def collate(self, samples: Sequence[Sample]) -> dict[str, Any]:
        """One batch: tensors are stacked, all else is listed, as are tensors of the keys in ``columns_of``."""
        return {key: self._batch(key, [sample[key] for sample in samples]) for key in samples[0]}

    def _batch(self, key: str, values: list[Any]) -> Any:
        is_stacked = isinstance(values[0], torch.Tensor) and key not in self.columns_of
        return torch.stack(values) if is_stacked else values

    def _tensors(self, key: str, value: Any) -> Any:
        if key in self.columns_of:
            return _tensor(columns(value, *self.columns_of[key]))
        if not isinstance(value, np.ndarray):
            return value
        if value.dtype.names is None:
            return _tensor(value)
        return {name: _tensor(value[name]) for name in value.dtype.names}


def _tensor(array: AnyArray) -> torch.Tensor:
    dtype = _WIDER.get(array.dtype.name, array.dtype)
    return torch.from_numpy(np.ascontiguousarray(array, dtype))
