"""The connection that writes: where it finds credentials, and processes that cannot have one."""

import multiprocessing
from pathlib import Path

import pytest
from store_server import BUCKET, StoreServer

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.store_client import KEY_VARIABLES
from simbev_ros.foundation.object_store.transfers import put_bytes

PATH = ObjectPath(BUCKET, "a")
KEYS = "aws_access_key_id = key\naws_secret_access_key = sec%ret\n"


@pytest.fixture
def home(store: StoreServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A home folder with the folder of AWS tools, for a store that needs a key, of which the environment has none."""
    for name in (*KEY_VARIABLES, "AWS_CONFIG_FILE", "AWS_SHARED_CREDENTIALS_FILE"):
        monkeypatch.delenv(name)
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / ".aws").mkdir()
    store.needs_key = True
    return tmp_path


@pytest.mark.parametrize(
    ("file", "section", "profile"),
    [("credentials", "default", None), ("credentials", "lab", "lab"), ("config", "profile lab", "lab")],
)
def test_keys_come_from_the_profile(
    home: Path, monkeypatch: pytest.MonkeyPatch, file: str, section: str, profile: str | None
) -> None:
    (home / ".aws" / file).write_text(f"[{section}]\n{KEYS}")
    if profile:
        monkeypatch.setenv("AWS_PROFILE", profile)
    put_bytes(b"1", PATH)
    assert PATH.read_bytes() == b"1", "reading finds the same keys"


def test_a_profile_without_keys_is_refused(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (home / ".aws/config").write_text("[profile lab]\nsso_session = x\n")
    monkeypatch.setenv("AWS_PROFILE", "lab")
    with pytest.raises(InputError, match=r"^AWS_PROFILE: lab has no credentials in ~/\.aws"):
        put_bytes(b"1", PATH)


def test_a_damaged_profile_is_named(home: Path) -> None:
    (home / ".aws/credentials").write_text("nonsense")
    with pytest.raises(InputError, match=r"^credentials for .*: Unable to parse config file: .*/\.aws/credentials"):
        put_bytes(b"1", PATH)


def _write() -> str:
    try:
        put_bytes(b"2", PATH)
    except RuntimeError as error:
        return str(error)
    return ""


def test_a_forked_process_is_refused_instead_of_hanging(store: StoreServer) -> None:
    put_bytes(b"1", PATH)
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert "forked" in pool.apply_async(_write).get(30)
