"""Streams of objects: the bytes of a file, with few requests."""

import io

import numpy as np
import pytest
from store_server import BUCKET, StoreServer

from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.object_reader import AHEAD_BYTES, prefetched
from simbev_ros.foundation.object_store.transfers import put_bytes

PATH = ObjectPath(BUCKET, "random.bin")
CONTENT = np.random.default_rng(5).bytes(12 << 20)


@pytest.fixture
def uploaded(store: StoreServer) -> StoreServer:
    put_bytes(CONTENT, PATH)
    store.reset()
    return store


def gets(store: StoreServer) -> int:
    return sum(request.startswith("GET") for request in store.requests)


def test_seeking_and_reading_are_those_of_a_file(uploaded: StoreServer) -> None:
    model = io.BytesIO(CONTENT)
    with PATH.open() as stream:
        for offset, whence, count in [(5, 0, 10), (100, 1, 7), (-50, 2, 20), (0, 1, -1), (len(CONTENT) + 9, 0, 4)]:
            assert stream.seek(offset, whence) == model.seek(offset, whence)
            assert stream.read(count) == model.read(count)
        with pytest.raises(ValueError, match="there is no byte -1"):
            stream.seek(-1)


def test_a_read_elsewhere_costs_one_request_of_its_size(uploaded: StoreServer) -> None:
    with PATH.open() as stream:
        for offset in (9 << 20, 3 << 20, 6 << 20):
            stream.seek(offset)
            assert stream.read(1000) == CONTENT[offset : offset + 1000]
    assert gets(uploaded) == 3
    assert uploaded.sent_bytes == 3000


def test_reads_that_follow_each_other_are_read_ahead(uploaded: StoreServer) -> None:
    with PATH.open() as stream:
        assert b"".join(iter(lambda: stream.read(1 << 18), b"")) == CONTENT
    assert gets(uploaded) == 1 + -(-(len(CONTENT) - (1 << 18)) // AHEAD_BYTES)
    assert uploaded.sent_bytes == len(CONTENT)


def test_prefetched_ranges_join_when_they_are_near(uploaded: StoreServer) -> None:
    near, far = [(1000, 1100), (5000, 5100), (100_000, 100_100)], [(4 << 20, (4 << 20) + 100), (8 << 20, 9 << 20)]
    with PATH.open() as stream:
        with prefetched(stream, [*far, *near]):
            assert gets(uploaded) == 3
            for start, end in (*near, *far):
                stream.seek(start)
                assert stream.read(end - start) == CONTENT[start:end]
            assert gets(uploaded) == 3
        stream.seek(1000)
        stream.read(100)
        assert gets(uploaded) == 4


def test_a_busy_store_is_asked_again(uploaded: StoreServer) -> None:
    uploaded.refuse_every = 2
    with PATH.open() as stream:
        assert stream.read() == CONTENT
