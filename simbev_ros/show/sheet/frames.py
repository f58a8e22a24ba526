"""Reads a scene as a series of sheet frames: at each of them the latest sample of everything that is shown.

A scene and its ``Views`` enter; ``SheetFrame``s, which contact sheets and videos draw, leave.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from simbev_ros.dataset.scene import Scene
from simbev_ros.foundation.types import AnyArray, BoolArray
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.show.sheet.ground_tint import GROUND_BITS
from simbev_ros.show.sheet.truth import Truth, leveled_pose
from simbev_ros.show.sheet.views import BOXES, LABELS, ODOMETRY, TRUTH, Views

HOLD_NS = NS_PER_S
"""Maximum age of the sample with which a slower sensor is shown, ns."""

_TRUTHS_HELD = 8
"""Number of values of each key of the ground truth that are held, as pictures of a frame can have different stamps."""


@dataclass(frozen=True, slots=True)
class SheetFrame:
    """The samples shown together at one tick; those of slower sensors are of earlier ticks.

    Attributes:
        index: Index among the scene's sheet frames.
        stamp_ns: Time of the frame.
        ticks: Tick of the sample by key; only keys that have a recent one.
        arrays: Value of the sample by key.
        truths: Ground truth at the time of the sample by key; only keys for which it is known.
    """

    index: int
    stamp_ns: int
    ticks: Mapping[str, int]
    arrays: Mapping[str, AnyArray]
    truths: Mapping[str, Truth]

    def simultaneous(self, key: str | None, other: str) -> AnyArray | None:
        """The sample of a key if its tick equals that of another key's sample, else None."""
        return self.arrays[key] if key and self.ticks.get(key) == self.ticks[other] else None


class FrameReader:
    """Reader of the sheet frames of a scene.

    Attributes:
        scene: The scene.
        views: What is shown.
        ticks: Tick of each frame: every tick at which anything with a picture has a sample, in order.
    """

    def __init__(self, scene: Scene, views: Views) -> None:
        self.scene, self.views = scene, views
        shown = np.any([scene.has([key]) for key in views.keys], axis=0)
        self.ticks: list[int] = np.flatnonzero(shown).tolist()
        self._value = lru_cache(maxsize=len(views.read_keys) + _TRUTHS_HELD * len(TRUTH))(self._read)

    @property
    def middle(self) -> int:
        """Index of the frame in the middle, see ``middle_frame``."""
        return middle_frame(self.scene.has([BOXES])[self.ticks])

    @property
    def rate_hz(self) -> float:
        """Frames per second of simulated time; 1 if there is only one frame."""
        ticks = np.median(np.diff(self.ticks)) if len(self.ticks) > 1 else NS_PER_S / self.scene.tick_ns
        return NS_PER_S / (float(ticks) * self.scene.tick_ns)

    def aspects(self) -> dict[str, float]:
        """Width over height of each key's picture; 1 for a point cloud."""
        firsts = {key: self._value(key, int(np.argmax(self.scene.has([key])))) for key in self.views.keys}
        return {key: first.shape[1] / first.shape[0] if first.ndim > 1 else 1.0 for key, first in firsts.items()}

    def frames(self, first: int, count: int, every: int = 1) -> Iterator[SheetFrame]:
        """Read every Nth one of ``count`` consecutive frames, starting at index ``first``."""
        for index in range(len(self.ticks))[first : first + count : every]:
            yield self._frame(index, self.ticks[index])

    def _frame(self, index: int, tick: int) -> SheetFrame:
        recent = {key: self._latest(key, tick) for key in self.views.read_keys}
        ticks = {key: found for key, found in recent.items() if found is not None}
        truths = {key: self._truth(ticks[key]) for key in self.views.keys if key in ticks}
        return SheetFrame(
            index,
            int(self.scene.stamps_ns[tick]),
            ticks,
            {key: self._value(key, found) for key, found in ticks.items()},
            {key: truth for key, truth in truths.items() if truth is not None},
        )

    def _truth(self, tick: int) -> Truth | None:
        """Ground truth at a tick; None if the agent's pose at that tick was not recorded, or no labels are drawn."""
        if self.views.labels == "off" or self._latest(ODOMETRY, tick) != tick:
            return None
        map_from_ego, labels = self._value(ODOMETRY, tick), self._latest(LABELS, tick)
        if labels is not None and self._latest(ODOMETRY, labels) != labels:
            labels = None
        bits = ~np.uint16(0) if labels == tick else GROUND_BITS  # what moves has moved since
        return Truth(
            map_from_ego,
            self._value(BOXES, tick) if self._latest(BOXES, tick) == tick else None,
            None if labels is None else self._value(LABELS, labels) & bits,
            leveled_pose(map_from_ego if labels is None else self._value(ODOMETRY, labels)),
        )

    def _latest(self, key: str, tick: int) -> int | None:
        """Tick of the last sample of a key up to a tick, unless it is older than ``HOLD_NS`` or there is none."""
        return self.scene[tick].last_tick(key, HOLD_NS) if key in self.scene.sources else None

    def _read(self, key: str, tick: int) -> Any:
        """Value of a key at a tick; the odometry as (4, 4) map_from_ego."""
        frame = self.scene[tick]
        return frame.map_from_ego if key == ODOMETRY else frame[key]


def middle_frame(has_boxes: BoolArray) -> int:
    """Index of the frame nearest to the middle of (N,) frames; of those with boxes, if there are any."""
    frames = np.flatnonzero(has_boxes if has_boxes.any() else ~has_boxes).tolist()
    return min(frames, key=lambda frame: abs(frame - len(has_boxes) // 2), default=0)
