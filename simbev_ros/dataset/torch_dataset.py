"""Frames as a torch ``Dataset`` for training. Only this module imports torch, which the package does not require.

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
from simbev_ros.foundation.types import AnyArray

Sample = dict[str, Any]

_WIDER = {"uint16": np.int32, "uint32": np.int64, "uint64": np.int64}
"""Signed dtypes that replace unsigned ones, which torch supports only in part."""


class FrameDataset(Dataset[Sample]):
    """Torch dataset with one sample per frame: a dict of values by key.

    A sample also has ``map_from_ego``, ``scene``, ``agent``, ``tick`` and ``stamp_ns``. Images are tensors in the
    layout of the arrays, (H, W) or (H, W, C); uint16 becomes int32, uint32 becomes int64. A point cloud or another
    table is a dict of columns, or one (N, K) tensor of the columns named in ``columns_of``.
    """

    def __init__(
        self,
        frames: Sequence[Frame],
        keys: Collection[str],
        columns_of: Mapping[str, Sequence[str]] | None = None,
        transform: Callable[[Sample], Sample] | None = None,
    ) -> None:
        """Create the dataset.

        Args:
            frames: Frames, usually from ``Dataset.frames``; each must have all ``keys``.
            keys: Keys of the values that a sample contains.
            columns_of: For tables, by key: names of the columns that are stacked into one tensor.
            transform: Called with each sample; returns the sample that is used instead.
        """
        self.frames, self.keys = frames, tuple(keys)
        self.columns_of, self.transform = dict(columns_of or {}), transform

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, index: int) -> Sample:
        frame = self.frames[index]
        if get_worker_info() is None:
            frame.load(self.keys)  # in threads; with loader workers the cores are busy already
        sample = {key: self._tensors(key, frame[key]) for key in self.keys}
        sample["map_from_ego"] = torch.from_numpy(frame.map_from_ego)
        sample.update(scene=frame.scene.name, agent=frame.scene.agent, tick=frame.tick, stamp_ns=frame.stamp_ns)
        return sample if self.transform is None else self.transform(sample)

    def collate(self, samples: Sequence[Sample]) -> dict[str, Any]:
        """Collate samples into a batch: stack tensors; put other values and the keys in ``columns_of`` into lists."""
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
