"""Any message of a bag by topic and time, reading no more than the chunk that holds it."""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode

from simbev_ros.errors import BagError
from simbev_ros.recording.chunk_cache import ChunkCache
from simbev_ros.recording.layout import SCENE_ATTACHMENT, locate_mcap
from simbev_ros.recording.mcap_index import MESSAGE_HEAD, RECORD_HEAD, read_index
from simbev_ros.recording.reader import attached_spec
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.types import Int64Array

_LATCHED = "durability: transient_local"


@dataclass(frozen=True, eq=False, slots=True)
class IndexedTopic:
    """One topic.

    Attributes:
        is_latched: Said once, for the whole scene.
        places: (N, 3) log time in ns, the chunk's offset in the file, the message's in the chunk; ascending by time,
            those of one time in the order of the file.
    """

    name: str
    type_name: str
    is_latched: bool
    places: Int64Array

    @property
    def stamps_ns(self) -> Int64Array:
        """(N,) log times, ns, ascending."""
        return self.places[:, 0]

    def between(self, after_ns: int, to_ns: int) -> Int64Array:
        """(K, 3) places of the messages after one time and up to another, that one itself included."""
        first, last = np.searchsorted(self.stamps_ns, [after_ns, to_ns], side="right")
        return self.places[first:last]


class IndexedBag:
    """One bag, whole or cut off. It keeps no file open: processes and threads can share it, and it can be pickled.

    Attributes:
        file: The MCAP file.
        topics: By name.

    Raises:
        BagError: There is no bag at this path, or it is damaged.
    """

    def __init__(self, path: Path, cache: ChunkCache) -> None:
        self.file = locate_mcap(path)
        self._cache = cache
        try:
            with self.file.open("rb") as stream:
                index = read_index(stream, str(self.file))
        except OSError as error:
            raise BagError(f"{self.file}: cannot be read: {error.strerror}") from None
        self._scene = {name: data for name, data in index.attachments.items() if name == SCENE_ATTACHMENT}
        self.topics: dict[str, IndexedTopic] = {}
        for channel_id, channel in index.channels.items():
            places = index.places[channel_id].table()
            places = places[np.argsort(places[:, 0], kind="stable")]
            schema = index.schemas.get(channel.schema_id)
            is_latched = _LATCHED in channel.metadata.get("offered_qos_profiles", "")
            self.topics[channel.topic] = IndexedTopic(channel.topic, schema.name if schema else "", is_latched, places)

    @property
    def spec(self) -> SceneSpec | None:
        """The drawn scene, if it was put in; made anew each time, as it is large. Raises BagError."""
        return attached_spec(self._scene, self.file)

    def payload(self, place: Int64Array) -> memoryview:
        """A message's bytes, CDR with its head, where they lie in a cached chunk, which they keep in memory.

        Args:
            place: (3,) row of a topic's places.

        Raises:
            BagError: The chunk is damaged, or the index is.
        """
        stamp_ns, chunk_offset, message_offset = place.tolist()
        chunk = self._cache.chunk(self.file, chunk_offset)
        try:
            opcode, length = RECORD_HEAD.unpack_from(chunk, message_offset)
            start = message_offset + RECORD_HEAD.size
            _, _, log_time_ns, _ = MESSAGE_HEAD.unpack_from(chunk, start)
        except struct.error:
            opcode = None
        if opcode != Opcode.MESSAGE or log_time_ns != stamp_ns:
            raise BagError(f"{self.file}: the index of the chunk at byte {chunk_offset} is damaged")
        return memoryview(chunk)[start + MESSAGE_HEAD.size : start + length]
