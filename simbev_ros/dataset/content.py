"""What the bags of one scene hold: its own bag, and additional ones of the same motion."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from simbev_ros.annotation.trajectories import Tracks, tracks_of_npz
from simbev_ros.dataset.calibration import Calibration, calibrations
from simbev_ros.dataset.values import message_of, value_of
from simbev_ros.errors import BagError
from simbev_ros.recording.indexed_bag import IndexedBag, IndexedTopic
from simbev_ros.recording.layout import SCENE_ATTACHMENT, TRAJECTORIES_ATTACHMENT
from simbev_ros.recording.mcap.chunk_cache import ChunkCache
from simbev_ros.recording.reader import SceneBag
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.types import Int64Array

_IMAGE = re.compile(r"/image_raw(/compressed|/compressedDepth)?$")
_SPORADIC = ("/world/events",)
_MOTION = ("clock", "odom", "tf")
"""What additional bags repeat."""


@dataclass(frozen=True, eq=False, slots=True)
class Source:
    """A topic in one of the scene's bags."""

    bag: IndexedBag
    topic: IndexedTopic

    @property
    def type_name(self) -> str:
        """ROS type, as in ``sensor_msgs/msg/Image``."""
        return self.topic.type_name

    @property
    def stamps_ns(self) -> Int64Array:
        """(N,) of its messages, ns, ascending."""
        return self.topic.stamps_ns

    def messages(self, places: Int64Array) -> list[Any]:
        """The messages at (K, …) places, decoded.

        Raises:
            BagError: The bag is damaged there.
        """
        try:
            return [message_of(self.type_name, self.bag.payload(place)) for place in places]
        except BagError as error:
            raise self._named(error) from None

    def value(self, places: Int64Array) -> Any:
        """What the messages at (K, …) places hold; of what happens now and then a list. Raises BagError."""
        messages = self.messages(places)
        try:
            if self.topic.name in _SPORADIC:
                return [value_of(self.type_name, [message]) for message in messages]
            return value_of(self.type_name, messages)
        except BagError as error:
            raise self._named(error) from None

    def _named(self, error: BagError) -> BagError:
        text = str(error).removeprefix(f"{self.bag.file}: ")
        return BagError(f"{self.bag.file}: {self.topic.name}: {text}")


@dataclass(frozen=True, eq=False, slots=True)
class Content:
    """All of a scene.

    Attributes:
        bag: Its own bag.
        sources: What is said again and again, by key.
        constants: What is said once for the whole scene, by key.
        calibration: By name of sensor.
        stamps_ns: (T,) of the ticks.
        tick_ns: From one to the next.
    """

    bag: IndexedBag
    sources: Mapping[str, Source]
    constants: Mapping[str, Source]
    calibration: Mapping[str, Calibration]
    stamps_ns: Int64Array
    tick_ns: int

    @classmethod
    def of(
        cls, path: Path, additional: Mapping[str, Path], cache: ChunkCache, *, may_be_cut_off: bool = False
    ) -> "Content":
        """That of a scene's bag, and of additional bags by label.

        A key that is taken gets the label behind it, as in ``cam_front/rgb@label``, and so do all keys of a sensor
        that there is already elsewhere or with other optics, and its name.

        Raises:
            BagError: A bag cannot be read, was cut off although that may not be, holds no scene, or an additional one
                has another motion.
        """
        bag = _opened(path, cache, may_be_cut_off)
        spec = spec_of(bag)
        sources, calibration = _sources(bag, spec), calibrations(spec.rig)
        stamps_ns = _stamps_ns(spec, sources)
        for label, place in sorted(additional.items()):
            other = _opened(place, cache, may_be_cut_off)
            other_spec = spec_of(other)
            if (other_spec.name, other_spec.start_ns) != (spec.name, spec.start_ns):
                raise BagError(f"{place}: its motion is that of scene {other_spec.name}, not of {spec.name} beside it")
            rig = calibrations(other_spec.rig)
            moved = {name for name, each in rig.items() if name in calibration and not each.is_like(calibration[name])}
            for key, source in _sources(other, other_spec).items():
                if key not in _MOTION:
                    taken = key in sources or key.partition("/")[0] in moved
                    sources[f"{key}@{label}" if taken else key] = source
            calibration |= {f"{name}@{label}" if name in calibration else name: each for name, each in rig.items()}
        constants = {key: source for key, source in sources.items() if source.topic.is_latched}
        frequent = {key: sources[key] for key in sorted(sources.keys() - constants.keys())}
        return cls(bag, frequent, constants, calibration, stamps_ns, spec.tick_ns)


def _opened(path: Path, cache: ChunkCache, may_be_cut_off: bool) -> IndexedBag:
    bag = IndexedBag(path, cache)
    if not (bag.closed or may_be_cut_off):
        raise BagError(f"{path}: it was cut off; simbev repair saves what is in it")
    return bag


def tracks_of(path: Path) -> Tracks:
    """The tracks of a bag's actors.

    Raises:
        BagError: The bag cannot be read, or holds none, as one that was not finished.
    """
    with SceneBag(path) as bag:
        file = bag.attachments.get(TRAJECTORIES_ATTACHMENT)
    if file is None:
        raise BagError(f"{path}: it holds no trajectories: {TRAJECTORIES_ATTACHMENT} is not attached")
    return tracks_of_npz(file)


def spec_of(bag: IndexedBag) -> SceneSpec:
    """The scene that a bag was recorded of.

    Raises:
        BagError: It holds none, or one of another version.
    """
    spec = bag.spec
    if spec is None:
        raise BagError(f"{bag.file}: it holds no scene: {SCENE_ATTACHMENT} is not attached")
    return spec


def sources_by_topic(bag: IndexedBag) -> dict[str, Source]:
    """Every topic of a bag by its name, readable at any time; the bag need not hold a scene, nor be finished."""
    return {name: Source(bag, topic) for name, topic in bag.topics.items()}


def _sources(bag: IndexedBag, spec: SceneSpec) -> dict[str, Source]:
    """By key: the topic's name without the agent, of an image without its form."""
    prefix = f"/{spec.rig.agent}/"
    return {
        _IMAGE.sub("", name.removeprefix(prefix).removeprefix("/")): source
        for name, source in sources_by_topic(bag).items()
    }


def _stamps_ns(spec: SceneSpec, sources: Mapping[str, Source]) -> Int64Array:
    """(T,) of all ticks up to that of the last message."""
    lasts = [spec.publishing_tick_of(int(each.stamps_ns[-1])) for each in sources.values() if len(each.stamps_ns)]
    return spec.start_ns + spec.tick_ns * np.arange(max(lasts, default=-1) + 1, dtype=np.int64)
