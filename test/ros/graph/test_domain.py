"""Locks of ROS domains: one graph per domain, and no folder or link of another user is ever used for them."""

import os
import tempfile
from pathlib import Path

import pytest

from simbev_ros.foundation.errors import InputError
from simbev_ros.ros.graph.domain import DomainLock


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of lock files, not made yet, in a folder of temporary files of the test."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    return tmp_path / f"simbev_ros-{os.getuid()}"


def test_a_domain_has_one_holder_at_a_time(folder: Path) -> None:
    with DomainLock(7), pytest.raises(InputError, match="ROS domain 7 is in use by another simbev graph"):
        DomainLock(7)
    with DomainLock(7), DomainLock() as other:
        assert other.domain != 7
    assert folder.stat().st_mode & 0o777 == 0o700


def test_a_domain_has_one_holder_for_each_namespace(folder: Path) -> None:
    with DomainLock(7), DomainLock(7, "/sim1"), DomainLock(7, "/sim1/a"):
        with pytest.raises(InputError, match="namespace /sim1 of ROS domain 7 is in use by another simbev graph"):
            DomainLock(7, "/sim1")
        assert len(list(folder.iterdir())) == 3


@pytest.mark.parametrize("mode", [0o770, 0o707, 0o777])
def test_a_folder_that_others_may_write_to_is_refused(folder: Path, mode: int) -> None:
    folder.mkdir()
    folder.chmod(mode)
    with pytest.raises(InputError, match=f"{folder}: another user owns it or may write to it; remove it, or set TMPD"):
        DomainLock(7)
    assert not list(folder.iterdir())


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a folder away")
def test_a_folder_of_another_user_is_refused_and_its_files_stay(folder: Path, tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_text("mine")
    folder.mkdir(mode=0o700)
    (folder / "domain-7.lock").symlink_to(precious)
    os.chown(folder, 12345, 12345)
    with pytest.raises(InputError, match="another user owns it"):
        DomainLock(7)
    assert precious.read_text() == "mine"


def test_links_are_not_followed(folder: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir(mode=0o700)
    folder.symlink_to(elsewhere)
    with pytest.raises(InputError, match=f"{folder}: cannot hold locks of ROS domains"):
        DomainLock(7)
    folder.unlink()
    folder.mkdir(mode=0o700)
    (folder / "domain-7.lock").symlink_to(elsewhere / "file")
    with pytest.raises(InputError, match=r"domain-7\.lock is a link"):
        DomainLock(7)
    assert not list(elsewhere.iterdir())


def test_the_content_of_a_lock_file_stays(folder: Path) -> None:
    folder.mkdir(mode=0o700)
    (folder / "domain-7.lock").write_text("content")
    with DomainLock(7):
        assert (folder / "domain-7.lock").read_text() == "content"


def test_a_file_in_place_of_the_folder_is_refused(folder: Path) -> None:
    folder.write_text("")
    with pytest.raises(InputError, match="Not a directory"):
        DomainLock(7)


@pytest.mark.parametrize("text", ["233", "-1", "x", "9" * 5000, "\u0663"])
def test_a_variable_that_is_no_domain_is_refused(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(InputError, match="ROS_DOMAIN_ID: must be a number from 0 to 232, not"):
        DomainLock()
