"""Reads a bag as a series of sheet frames: at each stamp the latest sample of every topic that is shown.

A bag and the ``Views`` of it enter; ``SheetFrame``s, which contact sheets and videos draw, leave.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from simbev_ros.dataset.content import sources_by_topic
from simbev_ros.dataset.values import ODOMETRY_TYPE, poses_from_odometry
from simbev_ros.foundation.types import AnyArray
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.recording.indexed_bag import IndexedBag
from simbev_ros.show.sheet.truth import Sample, Truth, truth_at
from simbev_ros.show.sheet.views import Views

HOLD_NS = NS_PER_S
"""Maximum age of the sample with which a slower sensor is shown, ns."""


@dataclass(frozen=True, slots=True)
class SheetFrame:
    """The samples shown together at one stamp. Unlike a dataset's frame it includes the last samples of slower sensors.

    Attributes:
        index: Index among the bag's sheet frames.
        stamp_ns: Time of the frame.
        stamps_ns: Time of the sample by topic; only topics that have a recent one.
        arrays: Value of the sample by topic.
        truths: Ground truth at the time of the sample by topic; only topics for which it is known.
    """

    index: int
    stamp_ns: int
    stamps_ns: Mapping[str, int]
    arrays: Mapping[str, AnyArray]
    truths: Mapping[str, Truth]

    def simultaneous(self, topic: str | None, other: str) -> AnyArray | None:
        """The sample of a topic if its stamp equals that of another topic's sample, else None."""
        return self.arrays[topic] if topic and self.stamps_ns.get(topic) == self.stamps_ns[other] else None


class FrameReader:
    """Reader of the sheet frames of a bag.

    Attributes:
        bag: The bag.
        views: The topics to show.
        stamps_ns: Stamp of each frame: the union of the stamps of all topics with a picture, in order.
    """

    def __init__(self, bag: IndexedBag, views: Views) -> None:
        sources = sources_by_topic(bag, bag.spec)
        self.bag, self.views = bag, views
        self._sources = {topic: sources[topic] for topic in views.read_topics}
        self._samples: dict[tuple[str, int], AnyArray] = {}
        stamps_ns = [self._sources[topic].stamps_ns for topic in views.topics]
        self.stamps_ns: list[int] = np.unique(np.concatenate(stamps_ns)).tolist()

    @property
    def rate_hz(self) -> float:
        """Frames per second of simulated time; 1 if there is only one frame."""
        return NS_PER_S / float(np.median(np.diff(self.stamps_ns))) if len(self.stamps_ns) > 1 else 1.0

    def aspects(self) -> dict[str, float]:
        """Width over height of each topic's picture; 1 for a point cloud."""
        firsts = {topic: self._sources[topic] for topic in self.views.topics}
        arrays = {topic: source.value(source.topic.locations[:1]) for topic, source in firsts.items()}
        return {topic: a.shape[1] / a.shape[0] if a.ndim > 1 else 1.0 for topic, a in arrays.items()}

    def frames(self, first: int, count: int, every: int = 1) -> Iterator[SheetFrame]:
        """Read every Nth one of ``count`` consecutive frames, starting at index ``first``."""
        for index in range(len(self.stamps_ns))[first : first + count : every]:
            stamp_ns = self.stamps_ns[index]
            yield self._frame(index, stamp_ns)
            self._forget(stamp_ns - 2 * HOLD_NS)

    def _frame(self, index: int, stamp_ns: int) -> SheetFrame:
        recent = {topic: self._latest(topic, stamp_ns) for topic in self.views.read_topics}
        found = {topic: sample for topic, sample in recent.items() if sample is not None}
        truths = {
            topic: truth_at(found[topic][0], self.views.truth, self._latest)
            for topic in self.views.topics
            if topic in found
        }
        return SheetFrame(
            index,
            stamp_ns,
            {topic: sample[0] for topic, sample in found.items()},
            {topic: sample[1] for topic, sample in found.items()},
            {topic: truth for topic, truth in truths.items() if truth is not None},
        )

    def _latest(self, topic: str, stamp_ns: int) -> Sample | None:
        """The last sample of a topic at or before a stamp, unless it is older than ``HOLD_NS``."""
        source = self._sources[topic]
        rows = source.topic.between(stamp_ns - HOLD_NS - 1, stamp_ns)[-1:]
        if not len(rows):
            return None
        key = topic, int(rows[0, 0])
        if key not in self._samples:
            value = source.value(rows)
            self._samples[key] = poses_from_odometry(value[-1]) if source.type_name == ODOMETRY_TYPE else value
        return key[1], self._samples[key]

    def _forget(self, before_ns: int) -> None:
        """Drop cached samples that no later frame shows."""
        latest = dict(sorted(self._samples))  # the highest stamp of a topic comes last
        truth = self.views.truth.names
        self._samples = {
            (topic, stamp_ns): array
            for (topic, stamp_ns), array in self._samples.items()
            if stamp_ns == latest[topic] or (topic in truth and stamp_ns > before_ns)
        }
