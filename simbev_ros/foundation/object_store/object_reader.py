"""Reads ranges of objects as seekable streams, with few and large requests."""

import io
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import BinaryIO

from simbev_ros.foundation.object_store.connection import connection, url_of

AHEAD_BYTES = 8 << 20
"""Bytes that are read at once as soon as reads follow each other."""
MAX_GAP_BYTES = 256 << 10
"""Ranges with a smaller gap between them are read as one, since a request takes longer than reading the gap."""
_MAX_REQUESTS = 16
"""Requests of one reader at the same time."""

Range = tuple[int, int]
"""First byte of a part of an object, and the byte after its last one."""


class ObjectReader(io.BufferedIOBase):
    """A seekable stream of an object; for one thread at a time.

    A read costs one request, unless it is in a part that is in memory: one that ``prefetched`` has read, or that was
    read ahead because reads followed each other.

    Args:
        bucket: Name of the bucket.
        key: The object's key.
        again: Whether to ask the store for its size even if this process has opened it before.

    Attributes:
        name: URL of the object.

    Raises:
        FileNotFoundError: There is no such object.
        StoreError: The store cannot be reached, refuses access, or fails (every method).
    """

    def __init__(self, bucket: str, key: str, *, again: bool = True) -> None:
        self.name = url_of(bucket, key)
        self._bucket, self._key = bucket, key
        self._size = connection().size(bucket, key, again=again)
        self._position, self._last_end = 0, -MAX_GAP_BYTES
        self._ahead: tuple[Range, bytes] = (0, 0), b""
        self._fetched: dict[Range, bytes] = {}

    def readable(self) -> bool:
        """Return True."""
        return True

    def seekable(self) -> bool:
        """Return True."""
        return True

    def tell(self) -> int:
        """Return the position in bytes."""
        return self._position

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        """Set the position, without a request, and return it."""
        base = {io.SEEK_SET: 0, io.SEEK_CUR: self._position, io.SEEK_END: self._size}[whence]
        if base + offset < 0:
            raise ValueError(f"{self.name}: there is no byte {base + offset}")
        self._position = base + offset
        return self._position

    def read(self, count: int | None = -1, /) -> bytes:
        """Read up to ``count`` bytes, fewer only at the end; all that follow for None or -1."""
        start = min(self._position, self._size)
        end = self._size if count is None or count < 0 else min(start + count, self._size)
        data = self._in_memory(start, end)
        if data is None:
            data = self._request_with_more(start, end)
        self._position = start + len(data)
        return data

    @contextmanager
    def fetched(self, ranges: Iterable[Range]) -> Iterator[None]:
        """Context in which ranges are in memory; near ones are read together, and the others at the same time."""
        missing, before = [each for each in _joined(ranges) if self._in_memory(*each) is None], dict(self._fetched)
        if missing:
            with ThreadPoolExecutor(min(len(missing), _MAX_REQUESTS), thread_name_prefix="ranges") as pool:
                self._fetched.update(zip(missing, pool.map(self._request, missing), strict=True))
        try:
            yield
        finally:
            self._fetched = before

    def _request_with_more(self, start: int, end: int) -> bytes:
        """Request a range, and what follows it if it follows the previous one."""
        last_end, self._last_end = self._last_end, end
        if not 0 <= start - last_end < MAX_GAP_BYTES:
            return self._request((start, end))
        block = start, min(max(end, start + AHEAD_BYTES), self._size)
        self._ahead = block, self._request(block)
        self._last_end = block[1]
        return self._ahead[1][: end - start]

    def _in_memory(self, start: int, end: int) -> bytes | None:
        """A range that is in memory; None if it is not."""
        if start == end:
            return b""
        for (first, last), data in (self._ahead, *self._fetched.items()):
            if first <= start and end <= last:
                return data[start - first : end - first]
        return None

    def _request(self, block: Range) -> bytes:
        return connection().read(self._bucket, self._key, *block)


@contextmanager
def prefetched(stream: BinaryIO, ranges: Iterable[Range]) -> Iterator[None]:
    """Context in which ranges of a stream are in memory if it reads an object; a file is read when it is asked."""
    if isinstance(stream, ObjectReader):
        with stream.fetched(ranges):
            yield
    else:
        yield


def _joined(ranges: Iterable[Range]) -> list[Range]:
    """Ranges in ascending order, with near ones joined."""
    joined: list[Range] = []
    for start, end in sorted(ranges):
        if joined and start - joined[-1][1] < MAX_GAP_BYTES:
            joined[-1] = joined[-1][0], max(joined[-1][1], end)
        else:
            joined.append((start, end))
    return joined
