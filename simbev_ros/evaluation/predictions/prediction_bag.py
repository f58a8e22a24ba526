"""Reads predictions from MCAP bags, with message types from ROS 2 Jazzy or from the file's own definitions.

``PredictionBag`` gives the boxes and score grids of each scene and tick. ``dataset_predictions`` describes the topics.
"""

import struct
from collections import ChainMap
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from simbev_ros.config.base import first_problem
from simbev_ros.evaluation.predictions.predicted_boxes import PredictedBoxes, Rows, join_boxes
from simbev_ros.evaluation.predictions.prediction_columns import ticks_of_stamps
from simbev_ros.evaluation.predictions.prediction_messages import (
    BOX_TYPES,
    IMAGE_TYPE,
    MARKERS_TYPE,
    OCCUPANCY_TYPE,
    image_scores,
    message_boxes,
    occupancy_scores,
    stamp_ns_of,
)
from simbev_ros.evaluation.predictions.score_grid import ScoreGrid
from simbev_ros.foundation.errors import FOREIGN_ERRORS, BagError, InputError
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import Float32Array, Int64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.recording.indexed_bag import IndexedBag, IndexedTopic
from simbev_ros.recording.mcap.chunk_cache import ChunkCache
from simbev_ros.recording.mcap.mcap_index import read_mcap_index
from simbev_ros.schema.scene.spec import SceneSpec, scene_number_of

_SCENE_TOPIC = "/world/scene"
_CDR_HEAD_BYTES = 4
_TYPES = get_typestore(Stores.ROS2_JAZZY)


class PredictionBag:
    """Reader of a bag with predictions for one scene, or for several in sequence.

    Attributes:
        scenes: Names of the scenes in /world/scene, or else the stem of the bag.
        has_scene_names: Whether the bag has a /world/scene.
        has_answers: Whether the bag has at least one of the topics.

    Raises:
        BagError: The bag cannot be read.
        InputError: One of the topics has an unknown type, or there are scores in both forms.
    """

    def __init__(self, path: Path, cache: ChunkCache, boxes_topic: str, grids_topic: str) -> None:
        self.path = path
        self._bag = IndexedBag(path, cache)
        self._own_types: dict[str, Typestore] = {}
        self._boxes = self._topic(boxes_topic, tuple(BOX_TYPES))
        self._grids = self._topic(grids_topic, (IMAGE_TYPE,))
        by_class = {name: self._topic(f"{grids_topic}/{name}", (OCCUPANCY_TYPE,)) for name in BEV_CLASSES}
        self._classes = {name: topic for name, topic in by_class.items() if topic is not None}
        self._grids_topic = grids_topic
        if self._grids and self._classes:
            both = f"{grids_topic} and {grids_topic}/{next(iter(self._classes))}"
            raise InputError(f"{self._bag.file}: there are scores on {both}; only one of them is allowed")
        self.topics = tuple(sorted(self._bag.topics))
        self.has_answers = bool(self._boxes or self._grids or self._classes)
        specs = self._specs()
        self.has_scene_names = bool(specs)
        self.scenes = tuple(dict.fromkeys(spec.name for spec in specs)) or (self._bag.file.stem.removesuffix("_0"),)
        self._numbers = {spec.number for spec in specs}
        self._found: dict[str, dict[str, dict[int, Int64Array]]] = {}

    def boxes(self, scene: str, stamps_ns: Int64Array) -> tuple[PredictedBoxes, frozenset[int]]:
        """Boxes of a scene, and the ticks that were answered; see ``prediction_sources.BoxSource``."""
        topic = self._boxes
        if topic is None:
            return join_boxes([]), frozenset()
        locations = self._locations(topic, scene, stamps_ns)
        parts = [
            message_boxes(topic.type_name, self._message(topic, location), tick, self._source(topic.name, tick))
            for tick, location in locations.items()
        ]
        return join_boxes(parts), frozenset(locations)

    def grid_ticks(self, scene: str, stamps_ns: Int64Array) -> frozenset[int]:
        """Ticks of a scene that have scores; see ``prediction_sources.GridSource``."""
        topics = [self._grids] if self._grids else [*self._classes.values()]
        return frozenset(tick for topic in topics for tick in self._locations(topic, scene, stamps_ns))

    def grid(self, scene: str, tick: int, stamps_ns: Int64Array) -> ScoreGrid:
        """Scores of a tick; see ``prediction_sources.GridSource``."""
        if self._grids:
            source = self._source(self._grids.name, tick)
            message = self._message(self._grids, self._locations(self._grids, scene, stamps_ns)[tick])
            return ScoreGrid(BEV_CLASSES, image_scores(message, source), source)
        locations = {name: self._locations(topic, scene, stamps_ns).get(tick) for name, topic in self._classes.items()}
        layers: dict[str, Float32Array] = {}
        for name, location in locations.items():
            if location is not None:
                topic = self._classes[name]
                layers[name] = occupancy_scores(self._message(topic, location), self._source(topic.name, tick))
        shapes = {scores.shape: name for name, scores in layers.items()}
        if len(shapes) > 1:
            sizes = ", ".join(f"{rows} x {columns} of {name}" for (rows, columns), name in shapes.items())
            raise InputError(f"{self._source(self._grids_topic, tick)}: info: {sizes} cells; all must have the same")
        return ScoreGrid(tuple(layers), np.stack([*layers.values()]), self._source(self._grids_topic, tick))

    def _source(self, topic: str, tick: int) -> str:
        """Name of a message, for error messages."""
        return f"{self._bag.file}: {topic}: tick {tick}"

    def _topic(self, name: str, types: tuple[str, ...]) -> IndexedTopic | None:
        topic = self._bag.topics.get(name)
        if topic is not None and topic.type_name not in types:
            raise InputError(f"{self._bag.file}: {name}: is a {topic.type_name}; allowed: {', '.join(types)}")
        return topic

    def _locations(self, topic: IndexedTopic, scene: str, stamps_ns: Int64Array) -> dict[int, Int64Array]:
        """Location of a topic's message for each tick, by ascending tick."""
        known = self._found.setdefault(scene, {})
        if topic.name not in known:
            known[topic.name] = self._locate_messages(topic, scene, stamps_ns)
        return known[topic.name]

    def _locate_messages(self, topic: IndexedTopic, scene: str, stamps_ns: Int64Array) -> dict[int, Int64Array]:
        """Find the message of each tick; raise InputError if a tick has two."""
        stamped = [(self._stamp_ns(topic, location), location) for location in topic.locations]
        relevant = [
            (stamp, location) for stamp, location in stamped if stamp is not None and self._concerns(stamp, stamps_ns)
        ]
        rows = Rows(f"{self._bag.file}: {topic.name}", np.arange(len(relevant)))
        ticks = ticks_of_stamps(np.array([stamp for stamp, _ in relevant], np.int64), rows, scene, stamps_ns).tolist()
        locations: dict[int, Int64Array] = {}
        for tick, (stamp, location) in sorted(zip(ticks, relevant, strict=True), key=lambda each: each[0]):
            if tick in locations:
                raise InputError(f"{rows.source}: stamp {stamp}: two answers to tick {tick}; only one is allowed")
            locations[tick] = location
        return locations

    def _concerns(self, stamp_ns: int, stamps_ns: Int64Array) -> bool:
        """Whether a frame must have this stamp: it is neither in the warm-up nor in another scene of this bag."""
        if not len(stamps_ns):
            return False
        first_ns, number = int(stamps_ns[0]), scene_number_of(stamp_ns)
        if number == scene_number_of(first_ns):
            return stamp_ns >= first_ns
        return number not in self._numbers

    def _stamp_ns(self, topic: IndexedTopic, location: Int64Array) -> int | None:
        """Stamp of a message; most types begin with a header, so that they need not be decoded."""
        payload = self._bag.payload(location)
        form = "<IiII" if payload[1] & 1 else ">IiII"
        if topic.type_name == MARKERS_TYPE:
            if len(payload) < _CDR_HEAD_BYTES + struct.calcsize(form):
                return None
            _, seconds, nanoseconds, text_bytes = struct.unpack_from(form, payload, _CDR_HEAD_BYTES)
            if text_bytes <= 1:  # an empty frame_id, only its terminator: another marker may have one
                return stamp_ns_of(self._message(topic, location))
        else:
            seconds, nanoseconds = struct.unpack_from(form[0] + "iI", payload, _CDR_HEAD_BYTES)
        return int(seconds) * NS_PER_S + int(nanoseconds)

    def _message(self, topic: IndexedTopic, location: Int64Array) -> Any:
        """Decode a message."""
        types = self._types_of(topic.type_name)
        try:
            return types.deserialize_cdr(self._bag.payload(location), topic.type_name)
        except (SerdeError, *FOREIGN_ERRORS) as error:
            raise BagError(f"{self._bag.file}: {topic.name} at {location[0]} ns: {error}") from None

    def _types_of(self, type_name: str) -> Typestore:
        """Type store with a message type: that of Jazzy, or else the definitions in the file."""
        if type_name in _TYPES.types:
            return _TYPES
        if type_name not in self._own_types:
            text = self._definitions.get(type_name)
            if text is None:
                raise BagError(f"{self._bag.file}: {type_name}: the file has no definition of it")
            types = get_typestore(Stores.ROS2_JAZZY)
            try:
                defined = get_types_from_msg(text, type_name)
                types.register({name: each for name, each in defined.items() if name not in types.types})
            except TypesysError as error:
                raise BagError(f"{self._bag.file}: {type_name}: its definition is damaged: {error}") from None
            self._own_types[type_name] = types
        return self._own_types[type_name]

    @cached_property
    def _definitions(self) -> ChainMap[str, str]:
        """Message definitions as text, by type."""
        found = []
        for file in self._bag.files:
            with file.open("rb") as stream:
                schemas = read_mcap_index(stream, str(file)).schemas.values()
            found.append(
                {each.name: each.data.decode(errors="replace") for each in schemas if each.encoding == "ros2msg"}
            )
        return ChainMap(*found)

    def _specs(self) -> list[SceneSpec]:
        """Scenes that /world/scene names."""
        topic = self._bag.topics.get(_SCENE_TOPIC)
        locations = [] if topic is None else [*topic.locations]
        try:
            return [SceneSpec.from_json(self._message(topic, location).data) for location in locations if topic]
        except ValidationError as error:
            raise BagError(f"{self._bag.file}: {_SCENE_TOPIC}: {first_problem(error)}") from None

    def __getstate__(self) -> dict[str, Any]:
        return {
            **self.__dict__,
            "_own_types": {},
            "_found": {},
        }  # classes that are generated here are unknown in other processes
