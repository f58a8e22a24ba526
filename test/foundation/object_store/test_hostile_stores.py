"""Stores that redirect, never end or send too much: each request ends with one line, and no other host gets any."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import pytest
from store_server import BUCKET, Made, StoreServer

from simbev_ros.foundation.object_store import connection as connections
from simbev_ros.foundation.object_store import store_client
from simbev_ros.foundation.object_store.connection import StoreError, connection
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import (
    copy_object,
    delete_objects,
    get_bytes,
    list_objects,
    put_bytes,
    put_file,
)

PATH = ObjectPath(BUCKET, "sets/a")
READS: list[Callable[[], object]] = [
    PATH.stat,
    PATH.read_bytes,
    PATH.exists,
    lambda: list_objects(PATH),
    lambda: list(PATH.iterdir()),
    lambda: get_bytes(PATH),
    lambda: connection().read(BUCKET, "sets/a", 0, 5),
]


@pytest.fixture
def elsewhere() -> Iterator[socket.socket]:
    """Another host, which notices connections."""
    with socket.create_server(("localhost", 0)) as listening:
        listening.setblocking(False)
        yield listening


def redirected_to(place: str, status: int = 307) -> Callable[[dict[str, Any]], Made]:
    return lambda _: (f"{status} Elsewhere", {"Location": place}, b"")


@pytest.mark.parametrize("status", [301, 302, 303, 307, 308])
@pytest.mark.parametrize("read", READS)
def test_another_host_gets_no_request_and_is_named(
    store: StoreServer, elsewhere: socket.socket, status: int, read: Callable[[], object]
) -> None:
    other = f"http://localhost:{elsewhere.getsockname()[1]}"
    store.stand_in = redirected_to(f"{other}/{BUCKET}/sets/a", status)
    with pytest.raises(StoreError, match=f"^s3://{BUCKET}.*: {store.url} redirects to '{other}/"):
        read()
    assert len(store.requests) == 1
    with pytest.raises(BlockingIOError):
        elsewhere.accept()


@pytest.mark.parametrize(
    "place", ["/made-up/b", "//[", "http://[::1", "http://a:99999/", "file:///etc/passwd", "/\xe9", "https://a@b/"]
)
def test_a_redirect_to_no_other_host_is_not_followed_either(store: StoreServer, place: str) -> None:
    store.stand_in = redirected_to(place)
    with pytest.raises(StoreError, match="redirects to "):
        PATH.stat()
    assert len(store.requests) == 1


def test_a_bucket_without_a_region_is_not_asked_for_it_again_and_again(store: StoreServer) -> None:
    store.stand_in = lambda _: ("301 Elsewhere", {}, b"")
    with pytest.raises(StoreError, match=r"301 \(HTTP status 301\): Moved Permanently"):
        PATH.stat()
    assert len(store.requests) == 1


def page(keys: list[str], token: str) -> Made:
    contents = "".join(f"<Contents><Key>{key}</Key><Size>1</Size></Contents>" for key in keys)
    more = f"<IsTruncated>true</IsTruncated><NextContinuationToken>{token}</NextContinuationToken>"
    return "200 OK", {}, f"<ListBucketResult>{contents}{more}</ListBucketResult>".encode()


def test_a_list_that_repeats_itself_ends(store: StoreServer) -> None:
    store.stand_in = lambda _: page(["sets/a/x"], "same")
    with pytest.raises(StoreError, match=f"^s3://{BUCKET}/sets/a: the store's list repeats itself"):
        list_objects(PATH)
    assert len(store.requests) == 2


@pytest.mark.parametrize(
    ("keys", "limit", "problem"),
    [
        (["x", "y"], "MAX_LISTED_OBJECTS", "the store lists more than 5 objects, or 1,000 pages"),
        ([], "MAX_EMPTY_PAGES", "objects, or 5 pages without one"),
    ],
)
def test_a_list_that_goes_on_ends_at_its_limit(
    store: StoreServer, monkeypatch: pytest.MonkeyPatch, keys: list[str], limit: str, problem: str
) -> None:
    monkeypatch.setattr(connections, limit, 5)
    store.stand_in = lambda _: page([f"sets/a/{key}{len(store.requests)}" for key in keys], f"{len(store.requests)}")
    for action in (lambda: list_objects(PATH), lambda: PATH.glob("*")):
        with pytest.raises(StoreError, match=problem):
            action()


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"<a",
        b"\xff",
        b"<a/>",
        b"<a><Contents><Key>x</Key></Contents></a>",
        b"<a><Contents><Key>x</Key><Size>much</Size></Contents></a>",
        b"<a><IsTruncated>true</IsTruncated></a>",
    ],
)
def test_a_damaged_list_is_refused(store: StoreServer, monkeypatch: pytest.MonkeyPatch, body: bytes) -> None:
    monkeypatch.setattr(store_client, "MAX_ATTEMPTS", 2)
    store.stand_in = lambda _: ("200 OK", {}, body)
    problem = "the store's (list is without|answer cannot be read)|HTTP status 500"  # what botocore makes of no XML
    with pytest.raises(StoreError, match=f"^s3://{BUCKET}/sets/a: .*({problem})"):
        list_objects(PATH)


def test_more_bytes_than_asked_for_are_not_read(store: StoreServer) -> None:
    store.stand_in = lambda _: ("206 Partial Content", {}, bytes(1000))
    with pytest.raises(StoreError, match=f"^s3://{BUCKET}/sets/a: .* sends more than the 10 bytes that were asked for"):
        connection().read(BUCKET, "sets/a", 5, 15)


@pytest.mark.parametrize("status", ["200 OK", "206 Partial Content"])
def test_other_bytes_than_asked_for_are_refused(store: StoreServer, status: str) -> None:
    store.stand_in = lambda _: (status, {}, bytes(10 if status == "200 OK" else 9))
    with pytest.raises(StoreError, match="the store does not send bytes 5 to 15 of it"):
        connection().read(BUCKET, "sets/a", 5, 15)


@pytest.mark.parametrize("headers", [{}, {"Last-Modified": "today"}])
def test_an_object_without_a_time_is_refused(store: StoreServer, headers: dict[str, str]) -> None:
    store.stand_in = lambda _: ("200 OK", headers, b"")
    with pytest.raises(StoreError, match=r"the store(?: does not say its size and time|'s answer cannot be read)"):
        PATH.stat()


@pytest.fixture
def dripping(store: StoreServer, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[bytes]]:
    """A store that sends these pieces with pauses of 20 ms; a minute of the measured time lasts 0.2 s."""
    monkeypatch.setattr(store_client, "RATE_WINDOW_S", 0.2)
    pieces: list[bytes] = []
    listening = socket.create_server(("127.0.0.1", 0))
    monkeypatch.setenv("AWS_ENDPOINT_URL_S3", f"http://127.0.0.1:{listening.getsockname()[1]}")

    def serve() -> None:
        with listening, suppress(OSError):
            channel, _ = listening.accept()
            with channel:
                channel.recv(1 << 16)
                for piece in pieces:
                    channel.sendall(piece)
                    time.sleep(0.02)

    thread = threading.Thread(target=serve)
    thread.start()
    yield pieces
    thread.join()


@pytest.mark.parametrize(
    "start", [b"", b"HTTP/1.1 206 Partial Content\r\nContent-Length: 500\r\n\r\n"], ids=["head", "body"]
)
def test_a_store_that_drips_is_given_up(dripping: list[bytes], start: bytes) -> None:
    dripping += [start, *[b"x"] * 500]
    with pytest.raises(StoreError, match=r"^s3://made-up/sets/a: the store sends less than 1,024 bytes a second"):
        connection().read(BUCKET, "sets/a", 0, 500)


def test_a_slow_store_is_waited_for(dripping: list[bytes]) -> None:
    dripping += [b"HTTP/1.1 206 Partial Content\r\nContent-Length: 5000\r\n\r\n", *[bytes(100)] * 50]
    assert connection().read(BUCKET, "sets/a", 0, 5000) == bytes(5000)


def test_a_body_that_is_cut_off_is_no_answer(dripping: list[bytes], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store_client, "MAX_ATTEMPTS", 1)
    dripping += [b"HTTP/1.1 206 Partial Content\r\nContent-Length: 500\r\n\r\n123"]
    with pytest.raises(StoreError, match="3 read, but total bytes expected is 500"):
        connection().read(BUCKET, "sets/a", 0, 500)


def test_a_store_that_is_silent_is_asked_again(dripping: list[bytes], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store_client, "MAX_ATTEMPTS", 2)
    with pytest.raises(StoreError, match="cannot be reached: Co"):
        PATH.stat()


@pytest.mark.parametrize(
    "write",
    [
        lambda _: put_bytes(b"1", PATH),
        lambda file: put_file(file, PATH),
        lambda _: copy_object(ObjectPath(BUCKET, "source"), PATH),
        lambda _: delete_objects([PATH]),
    ],
    ids=["put", "parts", "copy", "delete"],
)
def test_nothing_is_written_to_another_host(
    store: StoreServer, elsewhere: socket.socket, tmp_path: Any, write: Callable[[Any], object]
) -> None:
    (tmp_path / "large").write_bytes(bytes(9 << 20))
    put_bytes(b"1", ObjectPath(BUCKET, "source"))
    other = f"http://localhost:{elsewhere.getsockname()[1]}"
    moved = redirected_to(f"{other}/{BUCKET}/sets/a")
    store.stand_in = lambda environ: None if environ["PATH_INFO"].endswith("/source") else moved(environ)
    with pytest.raises(StoreError, match=f"{store.url} redirects to another address, which gets no request"):
        write(tmp_path / "large")
    with pytest.raises(BlockingIOError):
        elsewhere.accept()
