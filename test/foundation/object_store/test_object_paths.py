"""Paths of objects: names without a request, and what the store says about them."""

import pickle
import re
from pathlib import Path, PurePosixPath

import pytest
from store_server import BUCKET, StoreServer

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.object_store.connection import StoreError
from simbev_ros.foundation.object_store.object_path import ObjectPath, path_or_url, require_bucket, require_local
from simbev_ros.foundation.object_store.transfers import put_bytes


def test_a_url_becomes_a_path_and_a_url_again() -> None:
    path = path_or_url("s3://bucket/a/b.mcap/")
    assert path == ObjectPath("bucket", "a/b.mcap") and str(path) == "s3://bucket/a/b.mcap"
    assert str(path_or_url("S3://bucket")) == "s3://bucket"
    assert path_or_url("out/demo") == Path("out/demo")


def test_names_are_those_of_pathlib() -> None:
    path, model = ObjectPath("bucket", "sets/a.b/x_0.mcap"), PurePosixPath("/sets/a.b/x_0.mcap")
    assert (path.name, path.stem, path.suffix) == (model.name, model.stem, model.suffix)
    assert path.parent.key == str(model.parent)[1:]
    assert path.with_name("y").key == str(model.with_name("y"))[1:]
    assert path.parent.with_suffix("").key == str(model.parent.with_suffix(""))[1:]
    assert path.relative_to(ObjectPath("bucket", "sets")) == PurePosixPath("a.b/x_0.mcap")
    assert ObjectPath("bucket") / "a" / "b/c" == ObjectPath("bucket", "a/b/c")
    assert ObjectPath("bucket").name == "bucket" and ObjectPath("bucket").parent == ObjectPath("bucket")
    assert pickle.loads(pickle.dumps(path)) == path


@pytest.mark.parametrize("folder", [ObjectPath("other", "sets"), ObjectPath("bucket", "set")])
def test_a_path_is_not_relative_to_a_folder_that_it_is_not_in(folder: ObjectPath) -> None:
    with pytest.raises(ValueError, match="not in"):
        ObjectPath("bucket", "sets/a").relative_to(folder)


@pytest.mark.parametrize(
    ("url", "problem"),
    [
        ("gs://bucket/a", "URLs with gs:// are not supported; allowed: s3://bucket/prefix"),
        ("https://host/a", "URLs with https:// are not supported"),
        ("s3:///a", "'' is not a valid bucket name"),
        ("s3://a b/c", "'a b' is not a valid bucket name"),
    ],
)
def test_a_url_that_leads_nowhere_is_refused(url: str, problem: str) -> None:
    with pytest.raises(InputError, match=problem) as caught:
        path_or_url(url)
    assert str(caught.value).startswith(f"{url}: ")


def test_a_url_is_refused_where_only_local_folders_are_allowed() -> None:
    with pytest.raises(InputError, match=r"s3://bucket/a: only local folders are allowed here"):
        require_local(ObjectPath("bucket", "a"))


def test_the_store_says_what_exists(store: StoreServer) -> None:
    folder = ObjectPath(BUCKET, "sets/a")
    put_bytes(b"12345", folder / "x.mcap")
    put_bytes(b"", folder / "deep/y.mcap")
    assert folder.is_dir() and folder.exists() and not folder.is_file()
    assert (folder / "x.mcap").is_file() and (folder / "x.mcap").stat().st_size == 5
    assert not (folder / "z").exists()
    assert list(folder.iterdir()) == [folder / "deep", folder / "x.mcap"]
    assert list(folder.glob("*.mcap")) == [folder / "x.mcap"]
    assert list((folder / "none").iterdir()) == []


def test_an_object_that_is_missing_is_named(store: StoreServer) -> None:
    for action in (ObjectPath.stat, ObjectPath.open, ObjectPath.read_bytes):
        with pytest.raises(FileNotFoundError, match=f"no such object: 's3://{BUCKET}/none'"):
            action(ObjectPath(BUCKET, "none"))


def test_a_bucket_that_is_missing_is_named(store: StoreServer) -> None:
    require_bucket(ObjectPath(BUCKET, "none"))
    with pytest.raises(StoreError, match="s3://nobody/a: there is no bucket 'nobody'"):
        require_bucket(ObjectPath("nobody", "a"))
    with pytest.raises(StoreError, match="s3://nobody/a: there is no such bucket"):
        put_bytes(b"1", ObjectPath("nobody", "a"))


def test_an_object_above_the_limit_is_not_read(store: StoreServer) -> None:
    put_bytes(bytes(1 << 20), ObjectPath(BUCKET, "a"))
    assert len(ObjectPath(BUCKET, "a").read_bytes(1 << 20)) == 1 << 20
    store.reset()
    with pytest.raises(InputError, match=r"s3://made-up/a: is larger than 0 MiB"):
        ObjectPath(BUCKET, "a").read_bytes(1000)
    assert [request.split()[0] for request in store.requests] == ["HEAD"]


def test_refused_access_names_the_variables_without_credentials(
    store: StoreServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.needs_key = True
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    with pytest.raises(StoreError, match=r"access was refused .*AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY are not"):
        ObjectPath(BUCKET, "a").stat()


@pytest.mark.parametrize(
    "url", ["localhost:9000", "http://", "http://[::1", "http://a:99999", "http://a:0", "file:///etc", "http://a\n"]
)
@pytest.mark.parametrize("variable", ["AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL"])
def test_an_endpoint_that_is_no_web_address_is_refused(
    store: StoreServer, monkeypatch: pytest.MonkeyPatch, url: str, variable: str
) -> None:
    monkeypatch.delenv("AWS_ENDPOINT_URL_S3")
    monkeypatch.setenv(variable, url)
    text = f"{variable}: is {url!r}; allowed: a URL with http:// or"
    with pytest.raises(InputError, match=re.escape(text)):
        ObjectPath(BUCKET, "a").stat()


def test_the_general_endpoint_is_used_without_one_for_s3(store: StoreServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("AWS_ENDPOINT_URL_S3")
    monkeypatch.setenv("AWS_ENDPOINT_URL", store.url)
    put_bytes(b"1", ObjectPath(BUCKET, "a"))
    assert store.requests
