"""Tests that files are written whole: complete and on the disk before they get their name, or not at all."""

import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.whole_files import require_writable, whole_file, write_errors, write_whole


def test_a_file_is_written_from_bytes_or_pieces_and_its_folder_is_made(tmp_path: Path) -> None:
    write_whole(tmp_path / "new" / "a.json", b"whole")
    write_whole(tmp_path / "new" / "b.json", iter([b"in ", b"pieces"]))
    files = {path.name: path.read_bytes() for path in (tmp_path / "new").iterdir()}
    assert files == {"a.json": b"whole", "b.json": b"in pieces"}


def test_a_failing_writer_leaves_the_earlier_file(tmp_path: Path) -> None:
    def pieces() -> Iterator[bytes]:
        yield b"half of "
        raise KeyboardInterrupt

    (tmp_path / "a").write_bytes(b"before")
    with pytest.raises(KeyboardInterrupt):
        write_whole(tmp_path / "a", pieces())
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("a", b"before")]


def test_the_content_is_on_the_disk_before_the_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[tuple[int, bool]] = []
    monkeypatch.setattr(
        os, "fsync", lambda descriptor: synced.append((os.fstat(descriptor).st_ino, (tmp_path / "new/a").exists()))
    )
    with whole_file(tmp_path / "new" / "a") as unfinished:
        unfinished.write_bytes(b"content")
    file, *folders = synced
    assert file == ((tmp_path / "new/a").stat().st_ino, False)
    assert {inode for inode, _ in folders} == {tmp_path.stat().st_ino, (tmp_path / "new").stat().st_ino}
    assert all(named for _, named in folders)


def test_errors_name_the_file(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    with pytest.raises(InputError, match=r"/a: cannot be written: Is a directory"), write_errors(tmp_path / "a"):
        write_whole(tmp_path / "a", b"")
    assert list(tmp_path.iterdir()) == [tmp_path / "a"]


def test_a_link_in_place_of_the_unfinished_file_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "precious").write_bytes(b"mine")
    (tmp_path / "a.part").symlink_to(tmp_path / "precious")
    write_whole(tmp_path / "a", b"content")
    assert (tmp_path / "precious").read_bytes() == b"mine" and (tmp_path / "a").read_bytes() == b"content"


def test_a_folder_for_files_is_tried_without_a_trace(tmp_path: Path) -> None:
    require_writable(tmp_path / "new" / "folder")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").touch()
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for folder in (tmp_path / "file", tmp_path / "file/x", tmp_path / "loop", Path("/proc"), Path("x" * 5000)):
        with pytest.raises(InputError, match=f"^{folder}: cannot be written to: "):
            require_writable(folder)
    assert len(list(tmp_path.iterdir())) == 2


def test_devices_and_pipes_are_written_to_and_stay(tmp_path: Path) -> None:
    write_whole(Path("/dev/null"), b"gone")
    assert Path("/dev/null").is_char_device()
    os.mkfifo(pipe := tmp_path / "pipe")
    with pytest.raises(InputError, match=r"/pipe: cannot be written: No such device"), write_errors(pipe):
        write_whole(pipe, b"nobody reads")
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    (tmp_path / "link").symlink_to(pipe)
    for place in (pipe, tmp_path / "link"):
        write_whole(place, b"content")
        assert os.read(reader, 100) == b"content"
    os.close(reader)
    assert pipe.is_fifo() and (tmp_path / "link").is_symlink()


def test_nothing_but_a_regular_file_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "precious").write_bytes(b"mine")
    (tmp_path / "folder").mkdir()
    for name, target in (("link", "precious"), ("broken", "nothing"), ("to_folder", "folder")):
        (tmp_path / name).symlink_to(target)
        with pytest.raises(InputError, match=rf"/{name}: is a link to {target}; name the file itself"):
            write_whole(tmp_path / name, b"content")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "socket"))
        with pytest.raises(InputError, match="/socket: is a disk or a socket, not a file"):
            write_whole(tmp_path / "socket", b"content")
    assert (tmp_path / "precious").read_bytes() == b"mine"
    names = {"precious", "folder", "link", "broken", "to_folder", "socket"}
    assert {path.name for path in tmp_path.iterdir()} == names
