"""Cache of decompressed chunks, so that messages of the same chunk need only one decompression."""

import os
import threading
from collections import OrderedDict
from concurrent.futures import Future
from typing import Any

from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath
from simbev_ros.recording.mcap.chunks import read_chunk
from simbev_ros.recording.mcap.mcap_index import DAMAGE

_Key = tuple[AnyPath, int]


class ChunkCache:
    """Least recently used cache for the chunks of any number of bags.

    It is thread-safe; a thread that requests a chunk which another one is decompressing waits for it. Copies in other
    processes, forked or unpickled, start empty. No file stays open.

    Attributes:
        limit_bytes: Maximum size of all chunks together; the chunk requested last is always kept.
    """

    def __init__(self, limit_bytes: int) -> None:
        self.limit_bytes = limit_bytes
        self._clear()

    def chunk(self, file: AnyPath, offset: int, length: int) -> bytes:
        """Decompressed records of the chunk at an offset of an MCAP file; its length includes its header.

        Raises:
            BagError: The chunk is damaged or cannot be read.
        """
        if self._process != os.getpid():
            self._clear()
        key = file, offset
        with self._lock:
            future = self._chunks.get(key)
            is_mine = future is None
            if future is None:
                future = self._chunks[key] = Future()
            self._chunks.move_to_end(key)
        if is_mine:
            self._fill(key, length, future)
        return future.result()

    def _fill(self, key: _Key, length: int, future: Future[bytes]) -> None:
        try:
            data = _read(*key, length)
        except BaseException as error:
            with self._lock:
                del self._chunks[key]
            future.set_exception(error)
            return
        future.set_result(data)
        with self._lock:
            self._bytes += len(data)
            while self._bytes > self.limit_bytes and len(self._chunks) > 1:
                self._drop_oldest()

    def _drop_oldest(self) -> None:
        oldest = next(key for key, future in self._chunks.items() if future.done())
        self._bytes -= len(self._chunks.pop(oldest).result())

    def _clear(self) -> None:
        self._process = os.getpid()
        self._lock = threading.Lock()
        self._chunks: OrderedDict[_Key, Future[bytes]] = OrderedDict()
        self._bytes = 0

    def __getstate__(self) -> int:
        return self.limit_bytes

    def __setstate__(self, state: Any) -> None:
        self.limit_bytes = state
        self._clear()


def _read(file: AnyPath, offset: int, length: int) -> bytes:
    try:
        with file.open("rb", again=False) if isinstance(file, ObjectPath) else file.open("rb") as stream:
            return read_chunk(stream, offset, length)
    except OSError as error:
        raise BagError(f"{file}: cannot be read: {error.strerror}") from None
    except DAMAGE as error:
        raise BagError(f"{file}: damaged chunk at byte {offset}: {error}") from None
