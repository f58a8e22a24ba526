"""Keeps sweeps of the lidar and images with the ego's poses, so that a frame can have earlier ones."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from simbev_ros.baselines.frames import sweeps_of_frame
from simbev_ros.baselines.node.image_fit import ImageFit
from simbev_ros.foundation.types import Float32Array, Float64Array, Table, UInt8Array

_MARGIN_NS = 250_000_000
"""Time for which an input is kept after the oldest age that is asked for."""

ReadImage = Callable[[ImageFit], UInt8Array]
"""Gives an image (H, W, 3), RGB, in the model's size."""


class Sweep(NamedTuple):
    """A sweep of the lidar.

    Attributes:
        stamp_ns: Its stamp.
        points_ego: (N, 3) points, m, in the ego frame of its stamp.
        map_from_ego: (4, 4) pose of the ego.
    """

    stamp_ns: int
    points_ego: Float32Array
    map_from_ego: Float64Array


class ImageSet(NamedTuple):
    """Images that were taken at the same time.

    Attributes:
        stamp_ns: Their stamp.
        images: How to read them, by camera.
        map_from_ego: (4, 4) pose of the ego.
    """

    stamp_ns: int
    images: Mapping[str, ReadImage]
    map_from_ego: Float64Array


Item = TypeVar("Item", Sweep, ImageSet)


class InputMemory(Generic[Item]):
    """The sweeps or sets of images of the last moments, in the order of their stamps.

    Args:
        ages_ns: Ages of those of a frame, ascending; if there is only the age 0, the newest alone is kept.
    """

    def __init__(self, ages_ns: Sequence[int]) -> None:
        self._ages_ns = ages_ns
        self._kept_ns = ages_ns[-1] + _MARGIN_NS if ages_ns[-1] else 0
        self._items: deque[Item] = deque()

    def add(self, item: Item) -> None:
        """Add an item, which is later than all others; if time has gone back, these are forgotten."""
        if self._items and item.stamp_ns <= self._items[-1].stamp_ns:
            self._items.clear()
        while self._items and self._items[0].stamp_ns < item.stamp_ns - self._kept_ns:
            self._items.popleft()
        self._items.append(item)

    def of_frame(self, stamp_ns: int) -> list[Item | None]:
        """The items of a frame, newest first; None: there is none of that age."""
        items = list(self._items)
        stamps_ns = np.array([item.stamp_ns for item in items], np.int64)
        indices = sweeps_of_frame(stamp_ns, stamps_ns, self._ages_ns)
        return [items[index] if index >= 0 else None for index in indices]


def points_in_ego(cloud: Table, ego_from_lidar: Float64Array) -> Float32Array:
    """(N, 3) points, ego frame, of the rows of a cloud whose x, y and z (m, lidar frame) are finite.

    Raises:
        ValueError: The cloud has no such columns.
    """
    points = np.empty((len(cloud), 3), np.float32)
    for column, name in enumerate("xyz"):
        points[:, column] = cloud[name]
    finite = np.isfinite(points).all(axis=1)
    if not finite.all():
        points = points[finite]
    rotation, origin = ego_from_lidar[:3, :3].astype(np.float32), ego_from_lidar[:3, 3].astype(np.float32)
    return points @ rotation.T + origin
