"""Only files of this user's middleware are found in shared memory."""

import os
from pathlib import Path

import pytest

from simbev_ros.ros.graph import shared_memory
from simbev_ros.ros.graph.shared_memory import middleware_files, remove_orphans


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a file away")
def test_files_of_other_users_and_links_are_neither_found_nor_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shared_memory, "_FOLDER", tmp_path)
    own, foreign, link, other = (tmp_path / f"fastrtps_{name}" for name in ("own", "foreign", "link", "folder"))
    own.touch()
    foreign.touch()
    os.chown(foreign, 12345, 12345)
    link.symlink_to(foreign)
    other.mkdir()
    assert middleware_files() == [own]
    assert remove_orphans([own, foreign, link, other]) == [own]
    assert sorted(tmp_path.iterdir()) == [other, foreign, link]
