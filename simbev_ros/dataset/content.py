"""What the bags of one scene hold: its own bag, and additional ones of the same motion."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from simbev_ros.annotation.trajectories import Tracks, tracks_of_npz
from simbev_ros.dataset.calibration import Calibration, calibrations
from simbev_ros.dataset.values import message_of, value_of
from simbev_ros.errors import BagError
from simbev_ros.recording.chunk_cache import ChunkCache
from simbev_ros.recording.indexed_bag import IndexedBag, IndexedTopic
from simbev_ros.recording.layout import SCENE_ATTACHMENT, TRAJECTORIES_ATTACHMENT
from simbev_ros.recording.reader import SceneBag
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.types import Int64Array

T = TypeVar("T")

_IMAGE = re.compile(r"/image_raw(/compressed|/compressedDepth)?$")
_MOTION = ("clock", "odom", "tf")
"""What additional bags repeat."""


@dataclass(frozen=True, eq=False, slots=True)
class Source:
    """A topic in one of the scene's bags."""

    bag: IndexedBag
    topic: IndexedTopic

    def messages(self, places: Int64Array) -> list[Any]:
        """The messages at (K, 3) places, decoded.

        Raises:
            BagError: The bag is damaged there.
        """
        try:
            return [message_of(self.topic.type_name, self.bag.payload(place)) for place in places]
        except BagError as error:
            raise self._named(error) from None

    def value(self, places: Int64Array) -> Any:
        """What the messages at (K, 3) places hold. Raises BagError as ``messages``."""
        messages = self.messages(places)
        try:
            return value_of(self.topic.type_name, messages)
        except BagError as error:
            raise self._named(error) from None

    def _named(self, error: BagError) -> BagError:
        text = str(error).removeprefix(f"{self.bag.file}: ")
        return BagError(f"{self.bag.file}: {self.topic.name}: {text}")


@dataclass(frozen=True, eq=False, slots=True)
class Content:
    """All of a scene.

    Attributes:
        spec: The drawn scene.
        sources: What is said again and again, by key.
        constants: What is said once for the whole scene, by key.
        calibration: By name of sensor.
        stamps_ns: (T,) of the ticks.
    """

    spec: SceneSpec
    sources: Mapping[str, Source]
    constants: Mapping[str, Source]
    calibration: Mapping[str, Calibration]
    stamps_ns: Int64Array

    @classmethod
    def of(cls, path: Path, additional: Mapping[str, Path], cache: ChunkCache) -> "Content":
        """That of a scene's bag, and of additional bags by label.

        Raises:
            BagError: A bag cannot be read, holds no scene, or an additional one has another motion.
        """
        spec, bag = spec_of(path), IndexedBag(path, cache)
        sources, calibration = _sources(bag, spec), calibrations(spec.rig)
        stamps_ns = _stamps_ns(spec, sources)
        for label, place in sorted(additional.items()):
            other, other_bag = spec_of(place), IndexedBag(place, cache)
            if (other.name, other.start_ns, other.tick_ns) != (spec.name, spec.start_ns, spec.tick_ns):
                raise BagError(f"{place}: not of the same motion as {path}: it is of scene {other.name}")
            repeated = {key: source for key, source in _sources(other_bag, other).items() if key not in _MOTION}
            _enter(sources, repeated, label)
            _enter(calibration, calibrations(other.rig), label)
        constants = {key: sources.pop(key) for key in [k for k, each in sources.items() if each.topic.is_latched]}
        return cls(spec, sources, constants, calibration, stamps_ns)


def spec_of(path: Path) -> SceneSpec:
    """The scene that a bag was recorded of.

    Raises:
        BagError: The bag cannot be read, or holds no scene.
    """
    with SceneBag(path) as bag:
        spec = bag.spec
    if spec is None:
        raise BagError(f"{path}: it holds no scene: {SCENE_ATTACHMENT} is not attached")
    return spec


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


def _sources(bag: IndexedBag, spec: SceneSpec) -> dict[str, Source]:
    """By key: the topic's name without the agent, of an image without its form."""
    prefix = f"/{spec.rig.agent}/"
    keys = {name: _IMAGE.sub("", name.removeprefix(prefix).removeprefix("/")) for name in sorted(bag.topics)}
    return {key: Source(bag, bag.topics[name]) for name, key in keys.items()}


def _stamps_ns(spec: SceneSpec, sources: Mapping[str, Source]) -> Int64Array:
    """(T,) of all ticks up to that of the last message."""
    lasts = [source.topic.stamps_ns[-1] for source in sources.values() if len(source.topic.stamps_ns)]
    last = spec.publishing_tick_of(int(max(lasts, default=spec.start_ns - 1)))
    return spec.start_ns + spec.tick_ns * np.arange(last + 1, dtype=np.int64)


def _enter(known: dict[str, T], more: Mapping[str, T], label: str) -> None:
    """Add entries; those whose key is taken get the label behind it: ``cam_front/rgb@label``."""
    known.update({f"{key}@{label}" if key in known else key: value for key, value in more.items()})
