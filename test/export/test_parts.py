"""Tests of the protocol by which exports resume: finished parts are found again, and outdated ones are replaced."""

import json
import os
import shutil
from pathlib import Path

import pytest

from simbev_ros.export.parts import PARTS_FOLDER, Part, hold_export, is_begun, part_names
from simbev_ros.foundation.errors import InputError


def part(out: Path, source: str = "bag 1", name: str = "a") -> Part:
    return Part(out=out, name=name, identity={"source": source}, patterns=(f"*/{name}__*",))


def make(part: Part, *files: str) -> None:
    part.begin()
    for file in files:
        part.write(file, file.encode())
    part.finish({"count": len(files)})


def contents(out: Path) -> set[str]:
    """Paths of all files besides records."""
    return {
        str(path.relative_to(out)) for path in out.rglob("*") if path.is_file() and path.parent.name != PARTS_FOLDER
    }


def test_a_finished_part_has_its_files_and_a_record(tmp_path: Path) -> None:
    assert not is_begun(tmp_path) and part(tmp_path).record() is None
    make(part(tmp_path), "x/a__0", "y/a__0")
    assert is_begun(tmp_path) and part_names(tmp_path) == {"a"}
    assert part(tmp_path).record() == part(tmp_path).finished_record() == {"source": "bag 1", "count": 2}
    assert contents(tmp_path) == {"x/a__0", "y/a__0"} and (tmp_path / "x/a__0").read_bytes() == b"x/a__0"


def test_a_record_that_another_machine_wrote_is_found_when_the_folder_is_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make(part(tmp_path), "x/a__0")
    read_bytes, listed = Path.read_bytes, list[Path]()

    def read_if_listed(path: Path) -> bytes:
        if tmp_path / PARTS_FOLDER not in listed:
            raise FileNotFoundError
        return read_bytes(path)

    monkeypatch.setattr(Path, "read_bytes", read_if_listed)
    monkeypatch.setattr(Path, "iterdir", lambda folder: [listed.append(folder)])
    assert part(tmp_path).record() is None
    assert part(tmp_path).finished_record()["count"] == 1


def test_an_unfinished_part_has_no_file_at_its_final_path(tmp_path: Path) -> None:
    part(tmp_path).begin()
    part(tmp_path).write("x/a__0", b"")
    assert part(tmp_path).record() is None and not list(tmp_path.glob("x/*"))
    part(tmp_path).tidy_up()
    assert not contents(tmp_path) and not list((tmp_path / PARTS_FOLDER).iterdir())


def test_a_part_of_another_bag_replaces_the_earlier_one_and_no_other(tmp_path: Path) -> None:
    make(part(tmp_path), "x/a__0", "x/a__1")
    make(part(tmp_path, name="b"), "x/b__0")
    renewed = part(tmp_path, "bag 2")
    assert renewed.record() is None
    make(renewed, "x/a__0")
    assert contents(tmp_path) == {"x/a__0", "x/b__0"}
    assert renewed.record() == {"source": "bag 2", "count": 1} and part(tmp_path).record() is None


def test_a_run_that_ends_while_files_are_moved_is_redone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    replace = Path.replace

    def fail_at_the_second(path: Path, target: Path) -> Path:
        if list(tmp_path.glob("x/*")):
            raise KeyboardInterrupt
        return replace(path, target)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Path, "replace", fail_at_the_second)
        make(part(tmp_path), "x/a__0", "x/a__1")
    assert len(list(tmp_path.glob("x/*"))) == 1 and part(tmp_path).record() is None
    make(part(tmp_path, "bag 2"), "x/a__7")
    assert contents(tmp_path) == {"x/a__7"}


def test_a_run_that_ends_after_the_record_keeps_the_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(path: Path) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(shutil, "rmtree", fail)
        make(part(tmp_path), "x/a__0")
    part(tmp_path).tidy_up()
    assert contents(tmp_path) == {"x/a__0"} and part(tmp_path).record() is not None
    assert [path.name for path in (tmp_path / PARTS_FOLDER).iterdir()] == ["a.json"]


def test_a_damaged_record_is_none(tmp_path: Path) -> None:
    make(part(tmp_path), "x/a__0")
    (tmp_path / PARTS_FOLDER / "a.json").write_bytes(b'{"source": "ba')
    assert part(tmp_path).record() is None
    with pytest.raises(InputError, match=r"a\.json: this part of the export has been changed meanwhile"):
        part(tmp_path).finished_record()


def test_files_are_on_the_disk_before_the_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inodes: list[int] = []
    monkeypatch.setattr(os, "fsync", lambda descriptor: inodes.append(os.fstat(descriptor).st_ino))
    make(part(tmp_path / "out"), "x/y/a__0")
    record = inodes.index((tmp_path / "out" / PARTS_FOLDER / "a.json").stat().st_ino)
    before = ["out/x/y/a__0", "out/x/y", "out/x", "out"]
    assert {(tmp_path / path).stat().st_ino for path in before} <= set(inodes[:record])
    assert json.loads((tmp_path / "out" / PARTS_FOLDER / "a.json").read_text()) == {"source": "bag 1", "count": 1}


def test_a_folder_that_cannot_be_written_to_is_an_input_error(tmp_path: Path) -> None:
    (tmp_path / "out").write_bytes(b"a file")
    with pytest.raises(InputError, match=r"cannot be written: Not a directory"):
        part(tmp_path / "out").begin()


def test_an_export_does_not_go_into_a_dataset(tmp_path: Path) -> None:
    (tmp_path / "set/scenes").mkdir(parents=True)
    with pytest.raises(InputError, match="set: holds a dataset; choose another folder"), hold_export(tmp_path / "set"):
        pass
    assert [*(tmp_path / "set").iterdir()] == [tmp_path / "set/scenes"]


def test_a_link_that_leads_out_of_the_export_is_refused(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "out/samples").mkdir(parents=True)
    (tmp_path / "out/sweeps").symlink_to("samples")
    with hold_export(tmp_path / "out"):
        pass
    (tmp_path / "out/samples/CAM_FRONT").symlink_to(tmp_path / "elsewhere")
    problem = r"samples/CAM_FRONT: leads out of .*out, to .*elsewhere"
    with pytest.raises(InputError, match=problem), hold_export(tmp_path / "out"):
        pass
