"""A bag as a series of frames: at each tick, what every sensor that is worth a look has seen last."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np

from simbev_ros.recording.reader import SceneBag
from simbev_ros.types import AnyArray
from simbev_ros.viz.sheet.truth import HOLD_NS, History, Truth, decoded_array
from simbev_ros.viz.sheet.views import Views


@dataclass(frozen=True, slots=True)
class Frame:
    """What was seen at one tick.

    Attributes:
        index: Its place among the bag's frames.
        stamps_ns: By topic, when it was seen; only topics that have something recent.
        arrays: By topic.
        truths: By topic, what was true when it was seen; only where that is known.
    """

    index: int
    stamp_ns: int
    stamps_ns: Mapping[str, int]
    arrays: Mapping[str, AnyArray]
    truths: Mapping[str, Truth]

    def beside(self, topic: str | None, other: str) -> AnyArray | None:
        """What a topic has of the very time of another one."""
        return self.arrays[topic] if topic and self.stamps_ns.get(topic) == self.stamps_ns[other] else None


@dataclass(slots=True)
class FrameReader:
    """The frames of a bag.

    Attributes:
        stamps_ns: Stamp of each frame: every stamp that any of the topics with a picture has.
    """

    bag: SceneBag
    views: Views
    stamps_ns: list[int] = field(init=False)

    def __post_init__(self) -> None:
        stamps = [self.bag.topics[topic].stamps_ns for topic in self.views.topics]
        self.stamps_ns = np.unique(np.concatenate(stamps)).tolist()

    @property
    def rate_hz(self) -> float:
        """Frames per second of simulated time; 1 if there is one frame only."""
        return 1e9 / float(np.median(np.diff(self.stamps_ns))) if len(self.stamps_ns) > 1 else 1.0

    def aspects(self) -> dict[str, float]:
        """Width over height of each topic's picture; a point cloud's is square."""
        firsts = {topic: next(self.bag.messages([topic])) for topic in self.views.topics}
        arrays = {topic: decoded_array(self.bag, message) for topic, message in firsts.items()}
        return {topic: a.shape[1] / a.shape[0] if a.ndim > 1 else 1.0 for topic, a in arrays.items()}

    def frames(self, first: int, count: int) -> Iterator[Frame]:
        """``count`` frames from the one at index ``first`` on."""
        stamps_ns = self.stamps_ns[first : first + count]
        places = {stamp_ns: first + i for i, stamp_ns in enumerate(stamps_ns)}
        history = History(self.bag, self.views.truth)
        before_ns = stamps_ns[0] - 2 * HOLD_NS
        messages = self.bag.messages(self.views.read_topics, from_ns=before_ns, to_ns=stamps_ns[-1])
        for stamp_ns, group in groupby(messages, key=lambda message: message.stamp_ns):
            for message in group:
                history.add(message)
            if stamp_ns in places:
                yield self._frame(history, places[stamp_ns], stamp_ns)

    def _frame(self, history: History, index: int, stamp_ns: int) -> Frame:
        recent = {topic: history.latest(topic, stamp_ns) for topic in self.views.read_topics}
        found = {topic: message for topic, message in recent.items() if message is not None}
        stamps_ns = {topic: message.stamp_ns for topic, message in found.items()}
        truths = {topic: history.truth(stamps_ns[topic]) for topic in self.views.topics if topic in found}
        return Frame(
            index,
            stamp_ns,
            stamps_ns,
            {topic: history.array(message) for topic, message in found.items()},
            {topic: truth for topic, truth in truths.items() if truth is not None},
        )
