"""Random access to the messages of a bag by topic and time; each access reads only the chunk with the message."""

import struct
from collections import ChainMap
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel

from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.object_store.object_path import AnyPath
from simbev_ros.foundation.types import Int64Array
from simbev_ros.recording.layout import SCENE_ATTACHMENT, mcap_files, read_errors
from simbev_ros.recording.mcap.chunk_cache import ChunkCache
from simbev_ros.recording.mcap.chunks import MESSAGE_HEAD, RECORD_HEAD, plain_payload
from simbev_ros.recording.mcap.mcap_index import DAMAGE, McapIndex, read_mcap_index
from simbev_ros.recording.reader import COPIED_ATTACHMENTS, attached_spec, text_in
from simbev_ros.schema.scene.spec import SceneSpec

_LATCHED = "durability: transient_local"


@dataclass(frozen=True, eq=False, slots=True)
class IndexedTopic:
    """A topic with the locations of its messages.

    Attributes:
        is_latched: Whether the topic is published once for the whole scene.
        locations: (N, 4) int64: log time in ns, number of the file, offset of the chunk in the file, offset of the
            message in the chunk; ascending by time, with equal times in the order of the files.
    """

    name: str
    type_name: str
    is_latched: bool
    locations: Int64Array

    @property
    def stamps_ns(self) -> Int64Array:
        """(N,) log times, ns, ascending."""
        return self.locations[:, 0]

    def between(self, after_ns: int, to_ns: int) -> Int64Array:
        """(K, 4) locations of the messages later than ``after_ns`` and up to and including ``to_ns``."""
        first, last = np.searchsorted(self.stamps_ns, [after_ns, to_ns], side="right")
        return self.locations[first:last]


class IndexedBag:
    """A bag, complete or truncated, with random access to its messages.

    It keeps no file open; threads and processes can share it, and it can be pickled.

    Attributes:
        name: The scene's name.
        file: First MCAP file of the bag.
        files: All MCAP files.
        closed: Whether all files were closed by their writer; if not, the bag is truncated.
        topics: Topics by name.

    Raises:
        BagError: There is no bag at this path, or it is damaged.
    """

    def __init__(self, path: AnyPath, cache: ChunkCache) -> None:
        self.files = mcap_files(path)
        self.file, self._cache = self.files[0], cache
        self.name = self.file.stem.removesuffix("_0")
        indexes = [_index_of(file) for file in self.files]
        self.closed = all(index.closed for index in indexes)
        self._chunk_lengths = [{chunk.offset: chunk.length for chunk in index.chunks} for index in indexes]
        attached = ChainMap(*(index.attachments for index in indexes))
        parts: dict[str, list[tuple[int, McapIndex, Channel]]] = {}
        for number, index in enumerate(indexes):
            for channel in index.channels.values():
                parts.setdefault(channel.topic, []).append((number, index, channel))
        self.topics = {name: _topic(name, each) for name, each in parts.items()}
        self._scene = {name: data for name, data in attached.items() if name == SCENE_ATTACHMENT}
        copy = self.topics.get(COPIED_ATTACHMENTS[SCENE_ATTACHMENT])
        if not self._scene and copy is not None and len(copy.locations):
            self._scene[SCENE_ATTACHMENT] = text_in(self.payload(copy.locations[0]))

    @property
    def spec(self) -> SceneSpec | None:
        """The scene's specification, or None; parsed on every access, as it is large. Raises BagError."""
        return attached_spec(self._scene, self.file)

    def payload(self, location: Int64Array) -> memoryview:
        """Read a message's bytes: CDR with its header, as a view of a cached chunk, which the view keeps in memory.

        Args:
            location: (4,) row of a topic's locations.

        Raises:
            BagError: The chunk or the index is damaged.
        """
        stamp_ns, number, chunk_offset, message_offset = location.tolist()
        damage = f"{self.files[number]}: the index of the chunk at byte {chunk_offset} is damaged"
        chunk_length = self._chunk_lengths[number].get(chunk_offset)
        if chunk_length is None:
            raise BagError(damage)
        chunk = self._cache.chunk(self.files[number], chunk_offset, chunk_length)
        try:
            opcode, length = RECORD_HEAD.unpack_from(chunk, message_offset)
            start = message_offset + RECORD_HEAD.size
            _, _, log_time_ns, _ = MESSAGE_HEAD.unpack_from(chunk, start)
        except struct.error:
            opcode = None
        if opcode != Opcode.MESSAGE or log_time_ns != stamp_ns:
            raise BagError(damage)
        try:
            return memoryview(plain_payload(memoryview(chunk)[start + MESSAGE_HEAD.size : start + length]))
        except DAMAGE as error:
            raise BagError(f"{self.files[number]}: a message in the chunk at byte {chunk_offset}: {error}") from None


def _index_of(file: AnyPath) -> McapIndex:
    with read_errors(file), file.open("rb") as stream:
        return read_mcap_index(stream, str(file), [SCENE_ATTACHMENT])


def _topic(name: str, parts: Sequence[tuple[int, McapIndex, Channel]]) -> IndexedTopic:
    """Merge what the files, by number, contain of a topic."""
    _, index, channel = parts[0]
    schema = index.schemas.get(channel.schema_id)
    is_latched = _LATCHED in channel.metadata.get("offered_qos_profiles", "")
    tables = [np.insert(index.locations[channel.id].table(), 1, number, axis=1) for number, index, channel in parts]
    locations = np.concatenate(tables)
    return IndexedTopic(
        name, schema.name if schema else "", is_latched, locations[np.argsort(locations[:, 0], kind="stable")]
    )
