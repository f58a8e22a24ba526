"""The lock on a folder of an object store: one process at a time, free after a clean end or a minute of silence."""

import json
import os
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any

import pytest
from store_server import BUCKET, StoreServer
from waiting import wait_until

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.object_store import object_lock
from simbev_ros.foundation.object_store.object_lock import ObjectLock, require_writable_store
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import list_objects, put_bytes

FOLDER = ObjectPath(BUCKET, "sets/a")
LOCK = FOLDER / ".lock"


def test_a_second_process_is_told_who_holds_the_lock(store: StoreServer) -> None:
    holder = rf"process {os.getpid()} on {socket.gethostname()} is writing into it; its last heartbeat is \d s old"
    with ObjectLock(FOLDER), pytest.raises(InputError, match=f"^{FOLDER}: {holder}, and after 60 s without one"):
        ObjectLock(FOLDER)
    assert list_objects(FOLDER) == {LOCK: 0}


def test_the_lock_is_free_after_a_clean_end(store: StoreServer) -> None:
    for _ in range(2):
        with ObjectLock(FOLDER) as lock:
            lock.require()


def test_the_lock_of_a_killed_process_is_free_when_it_is_old(
    store: StoreServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    ObjectLock(FOLDER)  # which is not renewed
    monkeypatch.setattr(object_lock, "_EXPIRY_S", 0.0)
    with ObjectLock(FOLDER) as lock:
        lock.require()


def test_the_lock_is_renewed_while_it_is_held(store: StoreServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(object_lock, "_RENEWAL_S", 0.02)
    with ObjectLock(FOLDER):
        wait_until(lambda: sum(request.startswith("PUT /made-up/sets/a/.lock?") for request in store.requests) >= 3)


def test_a_lock_that_was_taken_over_is_neither_renewed_nor_released(
    store: StoreServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(object_lock, "_RENEWAL_S", 0.02)
    other = json.dumps({"host": "other", "pid": 7, "token": "x"}).encode()
    with ObjectLock(FOLDER) as lock:
        put_bytes(other, LOCK)
        assert not lock.renew()
        with pytest.raises(InputError, match=f"^{FOLDER}: process 7 on other has taken over"):
            lock.require()
        time.sleep(0.1)
    assert LOCK.read_bytes() == other


@pytest.mark.parametrize(
    "before", [None, b"", b'{"host": "dead", "pid": 7, "token": "x"}'], ids=["none", "free", "old"]
)
def test_of_processes_that_begin_at_the_same_time_one_gets_the_lock(
    store: StoreServer, monkeypatch: pytest.MonkeyPatch, before: bytes | None
) -> None:
    if before is not None:
        put_bytes(before, LOCK)
    monkeypatch.setattr(object_lock, "_EXPIRY_S", 0.0)
    at_once, read = threading.Barrier(4), ObjectLock._read

    def read_together(lock: ObjectLock) -> Any:
        found = read(lock)
        with suppress(threading.BrokenBarrierError):
            at_once.wait(30.0)
            at_once.abort()  # later reads do not wait
        return found

    monkeypatch.setattr(ObjectLock, "_read", read_together)
    with ThreadPoolExecutor(4) as pool:
        begun = [pool.submit(ObjectLock, FOLDER) for _ in range(4)]
    refused = [error for each in begun if (error := each.exception()) is not None]
    assert len(refused) == 3 and all("at the same time" in str(error) for error in refused)


def test_a_renewal_whose_answer_was_lost_is_not_taken_for_another_process(store: StoreServer) -> None:
    with ObjectLock(FOLDER) as lock:
        put_bytes(LOCK.read_bytes() + b"\n", LOCK)  # as after a request with an answer that got lost
        lock.require()
        lock.require()


@pytest.mark.parametrize(
    "content",
    [b"{", b"[]", b"\xff", b"[" * 100_000, b'{"pid": [[7]], "host": {"a": 1}}'],
    ids=["cut off", "list", "no text", "deep", "other types"],
)
def test_an_unreadable_lock_is_held_by_an_unknown_process(store: StoreServer, content: bytes) -> None:
    put_bytes(content, LOCK)
    with pytest.raises(InputError, match="process unknown on an unknown host is writing"):
        ObjectLock(FOLDER)


def test_the_names_in_a_foreign_lock_are_shown_in_one_line(store: StoreServer) -> None:
    put_bytes(b'{"pid": "7\\n8", "host": "a\\n\\nerror: b"}', LOCK)
    with pytest.raises(InputError, match=r"process 7 8 on a error: b is writing"):
        ObjectLock(FOLDER)


def test_a_folder_that_cannot_be_written_to_is_refused(store: StoreServer) -> None:
    store.is_read_only = True
    with pytest.raises(InputError, match=r"sets/a/\.lock\.\w+: access was refused \(AccessDenied\)"):
        require_writable_store(FOLDER)
