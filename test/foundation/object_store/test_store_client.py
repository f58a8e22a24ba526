"""The client that reads: its credentials and regions, when it asks again, and processes that fork after its use."""

import json
import multiprocessing
import subprocess
import sys
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from store_server import BUCKET, Made, StoreServer, put_any_key

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.object_store import store_client
from simbev_ros.foundation.object_store.connection import StoreError, connection
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.store_client import KEY_VARIABLES
from simbev_ros.foundation.object_store.transfers import put_bytes

PATH = ObjectPath(BUCKET, "a")


@pytest.fixture
def signatures(store: StoreServer) -> list[str]:
    """The store has an object; the list grows by the signature of each request, empty for an unsigned one."""
    put_any_key(PATH.key, b"12345")
    seen: list[str] = []

    def note(environ: dict[str, Any]) -> None:
        seen.append(environ.get("HTTP_AUTHORIZATION", ""))

    store.stand_in = note
    return seen


def test_requests_are_signed_with_the_key_of_the_environment(
    signatures: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert PATH.read_bytes() == b"12345"
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "other")
    monkeypatch.setenv("AWS_REGION", "eu-west-1")
    assert PATH.read_bytes() == b"12345"
    scopes = [signature.partition("Credential=")[2].split("/") for signature in signatures]
    assert [(scope[0], scope[2]) for scope in scopes] == 2 * [("key", "us-east-1")] + 2 * [("other", "eu-west-1")]


def test_requests_without_credentials_are_unsigned(
    signatures: list[str], store: StoreServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in KEY_VARIABLES:
        monkeypatch.delenv(name)
    note = store.stand_in
    assert note is not None
    store.stand_in = lambda environ: (
        note(environ) or ("200 OK", {"ETag": '"1"', "Content-Range": "bytes 0-2/3"}, b"123")
    )
    put_bytes(b"123", PATH)
    assert connection().read(BUCKET, "a", 0, 3) == b"123"
    assert signatures == ["", ""]


def test_half_a_key_is_refused(store: StoreServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("AWS_SECRET_ACCESS_KEY")
    for action in (PATH.stat, lambda: put_bytes(b"1", PATH)):
        with pytest.raises(InputError, match=r"^credentials for the object store: .* missing: AWS_SECRET_ACCESS_KEY$"):
            action()


def test_the_region_of_the_profile_is_used(
    signatures: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "config").write_text("[profile lab]\nregion = eu-central-1\nendpoint_url = http://127.0.0.1:1\n")
    monkeypatch.setenv("AWS_CONFIG_FILE", str(tmp_path / "config"))
    monkeypatch.setenv("AWS_PROFILE", "lab")
    PATH.read_bytes()
    put_bytes(b"1", PATH)
    assert all("/eu-central-1/s3/" in signature for signature in signatures)


def test_keys_of_a_role_read_and_write(store: StoreServer, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in KEY_VARIABLES:
        monkeypatch.delenv(name)
    monkeypatch.setenv("AWS_CONTAINER_CREDENTIALS_FULL_URI", f"{store.url}/role")
    end = (datetime.now(UTC) + timedelta(hours=1)).strftime("%Y-%m-%dT%H:%M:%SZ")
    role = {"AccessKeyId": "role-key", "SecretAccessKey": "secret", "Token": "token", "Expiration": end}
    seen = []

    def answer(environ: dict[str, Any]) -> Made | None:
        if environ["PATH_INFO"] == "/role":
            return "200 OK", {}, json.dumps(role).encode()
        seen.append((environ.get("HTTP_X_AMZ_SECURITY_TOKEN"), "Credential=role-key/" in environ["HTTP_AUTHORIZATION"]))
        return None

    store.stand_in = answer
    put_bytes(b"123", PATH)
    assert PATH.read_bytes() == b"123"
    assert seen == 3 * [("token", True)]
    assert sum("/role?" in request for request in store.requests) == 1


def test_the_region_of_a_bucket_is_learned(signatures: list[str], store: StoreServer) -> None:
    note = store.stand_in
    assert note is not None

    def elsewhere(environ: dict[str, Any]) -> Made | None:
        note(environ)
        is_wrong = "/eu-west-1/" not in signatures[-1]
        return ("301 Elsewhere", {"x-amz-bucket-region": "eu-west-1"}, b"") if is_wrong else None

    store.stand_in = elsewhere
    assert PATH.read_bytes() == b"12345"
    assert ["/eu-west-1/" in signature for signature in signatures] == [False, True, True]


@pytest.mark.parametrize("status", ["503 Slow Down", "429 Too Many", "500 Broken"])
def test_a_busy_store_is_asked_again(store: StoreServer, status: str) -> None:
    put_any_key(PATH.key, b"12345")
    answers: Iterator[Made | None] = iter([(status, {}, b""), None])
    store.stand_in = lambda _: next(answers)
    assert connection().read(BUCKET, "a", 0, 5) == b"12345"


def test_attempts_are_limited(store: StoreServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store_client, "MAX_ATTEMPTS", 3)
    store.refuse_every = 1
    with pytest.raises(StoreError, match=r"s3://made-up/a: SlowDown \(HTTP status 503\): Reduce your request rate\.$"):
        connection().read(BUCKET, "a", 0, 5)
    assert len(store.requests) == 3


def _read() -> bytes:
    return PATH.read_bytes()


def test_a_process_that_forks_after_use_reads(signatures: list[str]) -> None:
    assert PATH.read_bytes() == b"12345"
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.starmap_async(_read, [()] * 8).get(30) == [b"12345"] * 8
    assert PATH.read_bytes() == b"12345"


def test_a_local_folder_is_read_without_botocore() -> None:
    program = "import sys, simbev_ros.dataset.opened; print(*sys.modules)"
    found = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout.split()
    assert "simbev_ros.foundation.object_store.store_client" in found
    assert {"botocore", "urllib3", "obstore"} & {*found} == set()
