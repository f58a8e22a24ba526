"""Contents of a scene's bags, by key: its own bag, and additional bags recorded from the same motion.

The agents of a scene have the same content under different keys: those of an agent's own topics lack its name.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from simbev_ros.dataset.calibration import Calibration, calibrations
from simbev_ros.dataset.values import decode_message, in_ego_frame, value_of
from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.files.limits import MAX_SCENE_TICKS
from simbev_ros.foundation.object_store.object_path import AnyPath
from simbev_ros.foundation.types import Int64Array
from simbev_ros.recording.indexed_bag import IndexedBag, IndexedTopic
from simbev_ros.recording.layout import SCENE_ATTACHMENT, TRAJECTORIES_ATTACHMENT
from simbev_ros.recording.mcap.chunk_cache import ChunkCache
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.video import VIDEO_TYPE, VideoCursor
from simbev_ros.schema.scene.agents import AgentView, agent_views
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.trajectories import Tracks, tracks_from_npz

_IMAGE = re.compile(r"/image_raw(/compressed|/compressedDepth)?$|(?<=/rgb)/video$|(?<=points)/zstd$")
_OF_EGO = re.compile(r"/(prediction/.+|robot_description)")
"""Topics of the ego without its name, because ROS tools and perception stacks expect these names."""
_SPORADIC = ("/world/events", "/drive/events")
ODOMETRY = "odom"
"""Key of the ego's true motion."""
_MOTION = ("/clock", "/tf")
"""Topics that additional bags repeat from the scene's own bag, in addition to the odometry of all agents."""


@dataclass(frozen=True, eq=False, slots=True)
class Source:
    """A topic in one of a scene's bags, of which single messages can be read.

    Attributes:
        bag: The bag.
        topic: The topic.
        base_link_x_m: For an agent's true motion, x of base_link, the point with the recorded motion, in its ego frame.
        video: Decoder of the images of a video; None for other topics.
    """

    bag: IndexedBag
    topic: IndexedTopic
    base_link_x_m: float = 0.0
    video: VideoCursor | None = None

    @property
    def type_name(self) -> str:
        """ROS type, such as ``sensor_msgs/msg/Image``."""
        return self.topic.type_name

    @property
    def stamps_ns(self) -> Int64Array:
        """(N,) stamps of the topic's messages, ns, ascending."""
        return self.topic.stamps_ns

    def messages(self, locations: Int64Array) -> list[Any]:
        """Read and decode the messages at (K, 4) locations, rows of ``IndexedTopic.locations``.

        Raises:
            BagError: The bag is damaged there.
        """
        try:
            return [decode_message(self.type_name, self.bag.payload(location)) for location in locations]
        except BagError as error:
            raise self._with_topic(error) from None

    def value(self, locations: Int64Array) -> Any:
        """Read the messages at (K, 4) locations as one value; for a sporadic topic as a list with a value each.

        Raises:
            BagError: The bag is damaged there, or the messages cannot be decoded.
        """
        if self.video is not None:
            return self.video.image(int(np.searchsorted(self.stamps_ns, locations[-1, 0])), self._stream)
        messages = self.messages(locations)
        try:
            if self.topic.name in _SPORADIC:
                return [value_of(self.type_name, [message]) for message in messages]
            value = value_of(self.type_name, messages)
            return in_ego_frame(value, self.base_link_x_m) if self.base_link_x_m else value
        except BagError as error:
            raise self._with_topic(error) from None

    def _stream(self, index: int) -> bytes:
        """Data of one message of a video."""
        (message,) = self.messages(self.topic.locations[index : index + 1])
        return bytes(message.data)

    def _with_topic(self, error: BagError) -> BagError:
        text = str(error).removeprefix(f"{self.bag.file}: ")
        return BagError(f"{self.bag.file}: {self.topic.name}: {text}")


@dataclass(frozen=True, eq=False, slots=True)
class SceneBags:
    """The opened bags of a scene, which its agents share.

    Attributes:
        own: The scene's own bag.
        spec: Specification of the scene.
        additional: Additional bags by label, each with the specification that it was recorded from.
    """

    own: IndexedBag
    spec: SceneSpec
    additional: Mapping[str, tuple[IndexedBag, SceneSpec]]

    @classmethod
    def open(
        cls, path: AnyPath, additional: Mapping[str, AnyPath], cache: ChunkCache, *, may_be_cut_off: bool = False
    ) -> "SceneBags":
        """Open a scene's bag, and additional bags by label.

        Raises:
            BagError: A bag cannot be read, is truncated without ``may_be_cut_off``, holds no scene, or an
                additional bag has another motion.
        """
        own = _open(path, cache, may_be_cut_off)
        spec, others = _read_spec(own), {}
        for label, other_path in sorted(additional.items()):
            other = _open(other_path, cache, may_be_cut_off)
            other_spec = _read_spec(other)
            if (other_spec.name, other_spec.start_ns) != (spec.name, spec.start_ns):
                raise BagError(
                    f"{other_path}: its motion is that of scene {other_spec.name}, not of {spec.name} next to it"
                )
            others[label] = other, other_spec
        return cls(own, spec, others)


@dataclass(frozen=True, eq=False, slots=True)
class Content:
    """All topics of a scene by key, with the calibration of an agent's sensors and the stamps of the ticks.

    Attributes:
        sources: Topics that are published repeatedly, by key.
        constants: Latched topics, which are published once for the whole scene, by key.
        calibration: Calibrations of the agent's sensors by name.
        stamps_ns: (T,) stamps of the ticks.
        tick_ns: Time from one tick to the next.
    """

    sources: Mapping[str, Source]
    constants: Mapping[str, Source]
    calibration: Mapping[str, Calibration]
    stamps_ns: Int64Array
    tick_ns: int

    @classmethod
    def from_bags(cls, bags: SceneBags, view: AgentView) -> "Content":
        """Content of a scene's bags with the keys of one agent, given by its view of the scene.

        A key of an additional bag that is taken already gets the label as a suffix, as in ``cam_front/rgb@label``. So
        do the name and all keys of a sensor that exists already with another pose or other optics.

        Raises:
            BagError: A message is beyond the scene's end.
        """
        sources, calibration = _sources(bags.own, view), calibrations(view.rig)
        stamps_ns = _stamps_ns(bags.own, view.scene, sources)
        for label, (other, other_spec) in bags.additional.items():
            other_view = _view_in(other_spec, view)
            rig = {} if other_view is None else calibrations(other_view.rig)
            moved = {name for name, each in rig.items() if name in calibration and not each.matches(calibration[name])}
            repeated = {*_MOTION, *_base_links_m(other_spec)}
            for key, source in _sources(other, other_view or view).items():
                if source.topic.name not in repeated:
                    taken = key in sources or key.partition("/")[0] in moved
                    sources[f"{key}@{label}" if taken else key] = source
            calibration |= {f"{name}@{label}" if name in calibration else name: each for name, each in rig.items()}
        constants = {key: source for key, source in sources.items() if source.topic.is_latched}
        repeated_keys = sorted(sources.keys() - constants.keys())
        return cls({key: sources[key] for key in repeated_keys}, constants, calibration, stamps_ns, view.scene.tick_ns)


def _open(path: AnyPath, cache: ChunkCache, may_be_cut_off: bool) -> IndexedBag:
    bag = IndexedBag(path, cache)
    if not (bag.closed or may_be_cut_off):
        raise BagError(f"{path}: it was cut off; simbev repair saves what is in it")
    return bag


def read_tracks(path: AnyPath) -> Tracks:
    """Read the tracks of a bag's actors.

    Raises:
        BagError: The bag cannot be read, or holds no tracks because it was not finished.
    """
    with SceneBag(path) as bag:
        file = bag.attachments.get(TRAJECTORIES_ATTACHMENT)
    if file is None:
        raise BagError(f"{path}: it holds no trajectories: {TRAJECTORIES_ATTACHMENT} is not attached")
    return tracks_from_npz(file)


def _read_spec(bag: IndexedBag) -> SceneSpec:
    """Specification of a bag's scene. Raises BagError if the bag holds none, or one of another version."""
    spec = bag.spec
    if spec is None:
        raise BagError(f"{bag.file}: it holds no scene: {SCENE_ATTACHMENT} is not attached")
    return spec


def key_of_topic(name: str, view: AgentView) -> str:
    """Key of a topic for an agent: its name without the agent's and, for an image, without its transport.

    Topics of another agent keep the name of that agent, also topics of the ego without it.
    """
    if not view.is_ego and _OF_EGO.fullmatch(name):
        name = f"/{view.scene.agents[0].name}{name}"
    return _IMAGE.sub("", name.removeprefix(f"/{view.agent}/").removeprefix("/"))


def sources_by_topic(bag: IndexedBag, spec: SceneSpec | None) -> dict[str, Source]:
    """Every topic of a bag by topic name; the bag need neither hold a scene (then ``spec`` is None) nor be finished."""
    arms_m = {} if spec is None else _base_links_m(spec)
    return {
        name: Source(bag, topic, arms_m.get(name, 0.0), VideoCursor() if topic.type_name == VIDEO_TYPE else None)
        for name, topic in bag.topics.items()
    }


def _view_in(other: SceneSpec, view: AgentView) -> AgentView | None:
    """View of the same agent in an additional bag; the only agent of a scene may have another name there."""
    views = {each.agent: each for each in agent_views(other)}
    return views.get(view.agent, AgentView(other, 0) if len(view.scene.agents) == 1 else None)


def _base_links_m(spec: SceneSpec) -> dict[str, float]:
    """X of base_link in the ego frame of each agent, m, by the topic of the agent's odometry."""
    return {f"/{view.agent}/{ODOMETRY}": view.base_link_x_m for view in agent_views(spec)}


def _sources(bag: IndexedBag, view: AgentView) -> dict[str, Source]:
    """Sources by key."""
    return {key_of_topic(name, view): source for name, source in sources_by_topic(bag, view.scene).items()}


def _stamps_ns(bag: IndexedBag, spec: SceneSpec, sources: Mapping[str, Source]) -> Int64Array:
    """(T,) stamps of all ticks up to that of the last message. Raises BagError if that is beyond any scene's end."""
    ticks = 0
    for source in sources.values():
        if len(source.stamps_ns):
            last_ns = int(source.stamps_ns[-1])
            ticks = max(ticks, spec.publishing_tick_of(last_ns) + 1)
            if ticks > MAX_SCENE_TICKS:
                raise BagError(f"{bag.file}: {source.topic.name}: a message of {last_ns} ns is beyond the scene's end")
    return spec.start_ns + spec.tick_ns * np.arange(ticks, dtype=np.int64)
