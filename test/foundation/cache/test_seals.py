"""Content of the cache is believed if this user wrote it, under this name."""

import os
from pathlib import Path

import numpy as np
import pytest

from simbev_ros.foundation.cache import seals
from simbev_ros.foundation.cache.entries import entry_path
from simbev_ros.foundation.cache.files import read_cached
from simbev_ros.foundation.cache.folders import ensure_folder
from simbev_ros.foundation.errors import InputError


@pytest.fixture(autouse=True)
def _nothing_is_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(seals, "_checked", set())


def folder(cache: Path, name: str) -> Path:
    return ensure_folder("maps", name, b"1", b"", lambda work: [(work / "net").write_text(name)], cache)


def array(cache: Path, name: str) -> int:
    path = entry_path(cache / "meshes", name, b"1", b"") / "mesh.npy"
    return int(read_cached(path, "meshes", np.load, lambda file: np.save(file, len(name))))


def test_an_entry_under_the_name_of_another_is_built_anew(tmp_path: Path) -> None:
    blocks, town = folder(tmp_path, "Blocks"), folder(tmp_path, "Town")
    for content in blocks.iterdir():
        content.write_bytes((town / content.name).read_bytes())
    seals._checked.clear()
    assert (folder(tmp_path, "Blocks") / "net").read_text() == "Blocks"


def test_a_file_under_the_name_of_another_is_written_anew(tmp_path: Path) -> None:
    assert (array(tmp_path, "Blocks"), array(tmp_path, "Town")) == (6, 4)
    blocks, town = (next((tmp_path / "meshes").glob(f"{name}-*")) for name in ("Blocks", "Town"))
    for content in blocks.iterdir():
        content.write_bytes((town / content.name).read_bytes())
    seals._checked.clear()
    assert array(tmp_path, "Blocks") == 6


@pytest.mark.parametrize("change", ["changed", "added", "removed", "unsealed"])
def test_changed_content_is_built_anew(tmp_path: Path, change: str) -> None:
    entry = folder(tmp_path, "Blocks")
    if change in ("changed", "added"):
        (entry / ("net" if change == "changed" else "more")).write_text("else")
    else:
        (entry / ("net" if change == "removed" else ".sha256")).unlink()
    seals._checked.clear()
    assert {path.name: path.read_text() for path in folder(tmp_path, "Blocks").glob("[!.]*")} == {"net": "Blocks"}


def test_entries_of_others_and_links_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entry = folder(tmp_path, "Blocks")
    array(tmp_path, "Blocks")
    (mesh,) = (tmp_path / "meshes").iterdir()
    for each, make in ((entry, folder), (mesh, array)):
        each.chmod(0o777)
        with pytest.raises(InputError, match=rf"cache .*/{each.name}: is a link, or another user owns it"):
            make(tmp_path, "Blocks")
        each.chmod(0o755)
        each.rename(tmp_path / "elsewhere")
        each.symlink_to(tmp_path / "elsewhere")
        with pytest.raises(InputError, match=r"is a link|leads out of"):
            make(tmp_path, "Blocks")
        each.unlink()
        (tmp_path / "elsewhere").rename(each)
        assert make(tmp_path, "Blocks")
    if os.getuid() == 0:
        os.chown(entry, 12345, -1)
    else:
        monkeypatch.setattr(os, "getuid", lambda: 12345)
    with pytest.raises(InputError, match="another user owns it"):
        folder(tmp_path, "Blocks")
