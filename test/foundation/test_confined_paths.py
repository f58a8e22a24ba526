"""Paths from data stay in their folder, which may itself be a link."""

from pathlib import Path

import pytest

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.confined_paths import path_inside, refuse_links_out


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder that is reached through a link, beside one with a file."""
    (tmp_path / "disk/a/b").mkdir(parents=True)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere/secret").touch()
    (tmp_path / "folder").symlink_to(tmp_path / "disk")
    return tmp_path / "folder"


def test_entries_of_a_folder_that_is_a_link_are_inside(folder: Path) -> None:
    assert path_inside(folder, "a/b") == folder / "a/b"
    assert path_inside(folder, Path("new", "file")) == folder / "new/file"


@pytest.mark.parametrize("name", ["..", "../elsewhere/secret", "a/../../x", "/x", "", ".", "a/.."])
def test_names_that_lead_out_are_refused(folder: Path, name: str) -> None:
    with pytest.raises(InputError, match="leads out of"):
        path_inside(folder, name)


def test_links_that_lead_out_are_refused_at_every_depth(folder: Path, tmp_path: Path) -> None:
    (folder / "a/b/link").symlink_to("../../..")
    for path in ("a/b/link", "a/b/link/elsewhere/secret"):
        with pytest.raises(InputError, match=r"a/b/link.*leads out of .*folder, to /"):
            path_inside(folder, path)
    with pytest.raises(InputError, match=r"a/b/link: leads out of .*folder, to /"):
        refuse_links_out(folder, "a")
    refuse_links_out(folder, "new")


def test_links_that_stay_inside_are_allowed(folder: Path) -> None:
    (folder / "a/link").symlink_to("b")
    (folder / "a/loop").symlink_to("loop")
    (folder / "a/broken").symlink_to("nothing")
    refuse_links_out(folder, "a")
    refuse_links_out(folder, "a/link")
    assert path_inside(folder, "a/link") == folder / "a/link"
