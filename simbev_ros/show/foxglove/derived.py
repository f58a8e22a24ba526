"""Displays that bags do not contain, made from the recorded messages as the graph's nodes make them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from simbev_ros.drawing.displays.ego_path import EgoPath, PathPose
from simbev_ros.foundation.errors import FOREIGN_ERRORS, BagError
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.recording.arrays import image_array, point_array
from simbev_ros.recording.reader import RawMessage, SceneBag
from simbev_ros.ros.msgs.displays import SceneDisplay, scene_displays

_FORMS = ("/compressed", "/compressedDepth", "")
"""Endings of the topics that an image may be recorded on, as in image_transport; the first one is preferred."""


@dataclass(frozen=True, slots=True)
class Derivation:
    """How a topic is made.

    Attributes:
        sources: Recorded topics; each message of the first one leads to one of this topic.
    """

    sources: tuple[str, ...]
    _bag: SceneBag
    _display: SceneDisplay
    _paths: dict[str, EgoPath]

    @property
    def name(self) -> str:
        """The topic."""
        return self._display.topic.name

    @property
    def type_name(self) -> str:
        """Its type."""
        return self._display.topic.type

    def make(self, messages: Sequence[RawMessage]) -> bytes:
        """The serialized message that follows from messages of the sources, in their order.

        Raises:
            BagError: A message is malformed.
        """
        try:
            return self._display.make(messages[0].stamp_ns, *map(self._content, messages))
        except FOREIGN_ERRORS as error:
            words = " ".join(str(error).split())
            raise BagError(f"{self._bag.path}: {self.name} cannot be made: {words:.200}") from None

    def _content(self, message: RawMessage) -> Any:
        """Content of a message as displays take it."""
        decoded = self._bag.decode(message)
        match self._bag.topics[message.topic].type_name.rpartition("/")[2]:
            case "PointCloud2" | "CompressedPointCloud2":
                return point_array(decoded)
            case "Odometry":
                return self._path(message.topic).until(PathPose.of_odometry(decoded, message.stamp_ns))
            case "String":
                return _record(decoded.data)
            case _:
                return image_array(decoded)

    def _path(self, topic: str) -> EgoPath:
        """The path on a topic; when the first one is wanted, all its messages are read."""
        if topic not in self._paths:
            path = self._paths[topic] = EgoPath()
            try:
                for message in self._bag.messages([topic]):
                    path.add(PathPose.of_odometry(self._bag.decode(message), message.stamp_ns))
            except BagError:
                pass  # it is reported when it is played
        return self._paths[topic]


def derivations(bag: SceneBag) -> Mapping[str, Derivation]:
    """Topics of all agents that can be made of a bag and are not in it; none if its scene is not attached.

    Raises:
        BagError: The attached scene is damaged.
    """
    displays = () if bag.spec is None else scene_displays(bag.spec)
    found = (Derivation(tuple(_recorded(bag, each.sources)), bag, each, {}) for each in displays)
    return {
        each.name: each
        for each in found
        if each.name not in bag.topics and all(name in bag.topics for name in each.sources)
    }


def _recorded(bag: SceneBag, names: Sequence[str]) -> Iterator[str]:
    """Topics of a bag with the contents of topics; the names themselves if it has none."""
    for name in names:
        yield next((name + form for form in _FORMS if name + form in bag.topics), name)


def _record(text: str) -> dict[str, Any]:
    record = parse_json(text)
    if not isinstance(record, dict):
        raise ValueError("its text is not a JSON object")
    return record
