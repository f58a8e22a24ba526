"""Transfers: what is written can be read, is whole or not there, and deletion stays in its folder."""

from pathlib import Path

import numpy as np
import pytest
from store_server import BUCKET, StoreServer, upload

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.object_store import transfers
from simbev_ros.foundation.object_store.connection import StoreError
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import (
    copy_object,
    delete_tree,
    download,
    list_objects,
    put_bytes,
    put_file,
)

FOLDER = ObjectPath(BUCKET, "sets/a")


@pytest.fixture
def large(tmp_path: Path) -> Path:
    (tmp_path / "large.bin").write_bytes(np.random.default_rng(1).bytes(17 << 20))
    return tmp_path / "large.bin"


def test_a_large_file_is_uploaded_in_parts(store: StoreServer, large: Path) -> None:
    put_file(large, FOLDER / "large.bin")
    assert (FOLDER / "large.bin").read_bytes() == large.read_bytes()
    assert sum("partNumber=" in request for request in store.requests) > 1


def test_a_small_file_takes_one_request(store: StoreServer) -> None:
    put_bytes(b"123", FOLDER / "x")
    assert [request.split()[0] for request in store.requests] == ["PUT"]
    assert (FOLDER / "x").read_bytes() == b"123"


@pytest.mark.parametrize("size", [100, 17 << 20])
def test_an_upload_that_fails_leaves_nothing(
    store: StoreServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int
) -> None:
    (tmp_path / "x").write_bytes(bytes(size))
    stat = Path.stat
    monkeypatch.setattr(Path, "stat", lambda path, **more: _Longer(stat(path, **more).st_size))
    with pytest.raises(StoreError, match=rf"s3://made-up/sets/a/x: not written: {size:,} of {size + 1:,} bytes"):
        put_file(tmp_path / "x", FOLDER / "x")
    assert list_objects(FOLDER) == {}


class _Longer:
    def __init__(self, size: int) -> None:
        self.st_size = size + 1


def test_a_busy_store_gets_the_whole_file(store: StoreServer, large: Path) -> None:
    store.refuse_every = 3
    put_file(large, FOLDER / "large.bin")
    assert (FOLDER / "large.bin").read_bytes() == large.read_bytes()


@pytest.mark.parametrize("max_bytes", [5 << 30, 1 << 20])
def test_an_object_is_copied_by_the_store_unless_it_is_too_large(
    store: StoreServer, large: Path, monkeypatch: pytest.MonkeyPatch, max_bytes: int
) -> None:
    monkeypatch.setattr(transfers, "MAX_COPY_BYTES", max_bytes)
    put_file(large, FOLDER / "x")
    store.reset()
    copy_object(FOLDER / "x", FOLDER / "y")
    assert store.sent_bytes == (0 if max_bytes > 17 << 20 else 17 << 20)
    assert (FOLDER / "y").read_bytes() == large.read_bytes()


def test_the_store_may_take_its_time_to_copy(store: StoreServer) -> None:
    put_bytes(b"123", FOLDER / "x")
    store.copy_s = 4.0  # the SDK would ask again after 3 s
    copy_object(FOLDER / "x", FOLDER / "y")
    assert sum(request.startswith("PUT /made-up/sets/a/y") for request in store.requests) == 1


def test_a_tree_is_listed_and_deleted_without_its_neighbors(store: StoreServer) -> None:
    for name in ("a/x", "a/deep/er/y", "ab/z"):
        put_bytes(name.encode(), FOLDER.parent / name)
    assert list_objects(FOLDER) == {FOLDER / "deep/er/y": 11, FOLDER / "x": 3}
    delete_tree(FOLDER)
    assert not FOLDER.exists()
    delete_tree(FOLDER)
    assert list_objects(FOLDER.parent) == {FOLDER.parent / "ab/z": 4}
    with pytest.raises(ValueError, match="a whole bucket is never deleted"):
        delete_tree(ObjectPath(BUCKET))


def test_a_folder_comes_back_as_it_was(store: StoreServer, tmp_path: Path) -> None:
    (tmp_path / "set/deep").mkdir(parents=True)
    for name, size in (("set/a", 3), ("set/deep/b", 9 << 20), ("set/empty", 0)):
        (tmp_path / name).write_bytes(np.random.default_rng(size).bytes(size))
    upload(tmp_path / "set", "sets/a")
    store.reset()
    download(list_objects(FOLDER), FOLDER, tmp_path / "back")
    for name in ("a", "deep/b", "empty"):
        assert (tmp_path / "back" / name).read_bytes() == (tmp_path / "set" / name).read_bytes()
    listing = next(request for request in store.requests if "list-type" in request)
    assert listing.startswith("GET")
    assert (9 << 20) + 3 <= store.sent_bytes < (9 << 20) + 10_000  # and the listing


def test_a_key_cannot_leave_the_folder(store: StoreServer, tmp_path: Path) -> None:
    bad = ObjectPath(BUCKET, "sets/a/../../x")
    with pytest.raises(InputError, match="leads out of"):
        download({bad: 3}, FOLDER, tmp_path / "back")
