"""Tests that an interrupted nuScenes export resumes, outdated parts are made again, and bad input is explained."""

import json
import os
import shutil
from pathlib import Path
from typing import Any

import pytest
from made_up_scene import SENSORS, labeled_at, made_up_scene, made_up_spec, record_made_up
from nuscenes_tables import digest, export, tables_of
from typer.testing import CliRunner

from simbev_exporters.nuscenes import scene_tables, sensor_files
from simbev_ros.cli.main import app
from simbev_ros.foundation.errors import InputError
from simbev_ros.recording.layout import locate_mcap


def test_an_interrupted_export_resumes(nuscenes_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = 0

    def fails_late(*arguments: Any) -> bytes:
        nonlocal calls
        calls += 1
        if calls == 110:  # in the second scene
            raise KeyboardInterrupt
        return sensor_files.encode_file(*arguments)

    monkeypatch.setattr(scene_tables, "encode_file", fails_late)
    with pytest.raises(KeyboardInterrupt):
        export(nuscenes_folder / "set", tmp_path)
    assert not list(tmp_path.glob("s*/*/Blocks-0001*")) and not (tmp_path / "v1.0-trainval").exists()
    done = export(nuscenes_folder / "set", tmp_path)
    assert (done.scenes, done.made) == (2, 1)
    assert digest(tmp_path) == digest(nuscenes_folder / "out")
    assert export(nuscenes_folder / "set", tmp_path).made == 0
    record = json.loads((tmp_path / ".parts/Blocks-0000.head.json").read_text())
    assert list(record) == ["made_from", "summary"]
    settings = ["keyframe_hz", "sweeps", "keep_unhit", "channels"]
    assert list(record["made_from"]) == ["bytes", "mtime_ns", "by", *settings]


OPTIONS = {"lidarseg": False, "map_expansion": False, "can_bus": False}


def test_what_is_left_out_later_is_removed_and_comes_back_whole(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000")
    export(tmp_path / "set", tmp_path / "plain", **OPTIONS)
    export(tmp_path / "set", tmp_path / "out")
    whole = digest(tmp_path / "out")
    assert export(tmp_path / "set", tmp_path / "out", **OPTIONS).made == 0
    assert digest(tmp_path / "out") == digest(tmp_path / "plain")
    assert export(tmp_path / "set", tmp_path / "out").made == 0
    assert digest(tmp_path / "out") == whole


def test_a_scene_that_is_away_for_a_while_comes_back_whole(nuscenes_folder: Path, tmp_path: Path) -> None:
    shutil.copytree(nuscenes_folder / "out", tmp_path / "out")
    bag = nuscenes_folder / "set/scenes/val/Blocks-0001"
    assert export(bag, tmp_path / "out").scenes == 1
    rows = json.loads((tmp_path / "out/v1.0-trainval/lidarseg.json").read_text())
    assert len(rows) == len(list((tmp_path / "out/lidarseg/v1.0-trainval").iterdir())) == 2, "as the devkit demands"
    assert export(nuscenes_folder / "set", tmp_path / "out").made == 0
    assert digest(tmp_path / "out") == digest(nuscenes_folder / "out")


def test_a_part_with_other_settings_is_replaced(tmp_path: Path) -> None:
    bag = tmp_path / "set/scenes/train/Blocks-0000"
    made_up_scene(bag, ticks=23)
    export(tmp_path / "set", tmp_path / "out")
    assert export(tmp_path / "set", tmp_path / "out", sweeps=False, keyframe_hz=None).made == 1
    with pytest.raises(InputError, match=r"^keyframe_hz: 3 does not divide the 20 frames/s"):
        export(tmp_path / "set", tmp_path / "out", keyframe_hz=3)  # the existing part is kept
    assert not list((tmp_path / "out").glob("sweeps/*/*"))
    assert len(list((tmp_path / "out/samples/RADAR_FRONT").iterdir())) == 23


def test_frames_without_labels_are_sweeps_and_never_keyframes(tmp_path: Path) -> None:
    spec = labeled_at(made_up_spec(SENSORS, ticks=12), 4)
    made = record_made_up(tmp_path / "set/scenes/train/Blocks-0000", spec)
    assert ["boxes" in values for values in made.ticks] == [tick % 5 == 0 for tick in range(12)]
    export(tmp_path / "set", tmp_path / "out", keyframe_hz=None)
    tables = tables_of(tmp_path / "out")
    start_us = spec.start_ns // 1000
    assert [(row["timestamp"] - start_us) // 50_000 for row in tables["sample"]] == [0, 5, 10]
    data = [row for row in tables["sample_data"] if "RADAR_FRONT" in row["filename"]]
    is_key = {(row["timestamp"] - start_us) // 50_000: row["is_key_frame"] for row in data}
    assert is_key == {tick: tick % 5 == 0 for tick in range(12)}
    export(tmp_path / "set", tmp_path / "slow", keyframe_hz=2)
    assert len(tables_of(tmp_path / "slow")["sample"]) == 2
    with pytest.raises(
        InputError, match=r"^keyframe_hz: 10 does not divide the 4 frames/s with labels of .*Blocks-0000$"
    ):
        export(tmp_path / "set", tmp_path / "fast", keyframe_hz=10)


DEEP = b"[" * 100_000


@pytest.mark.parametrize(
    ("name", "replaced", "by", "named"),
    [
        ("Blocks-0000.head", b'"summary"', b'"other"', "'summary'"),
        ("Blocks-0000.head", b'"low_m": [', b'"low_m": ["", ', ""),
        ("Blocks-0000.v1.0-trainval.lidarseg", b'"rows": [', b'"rows": ["",', ""),
        ("Blocks-0000", b'"scene": ', b'"other": ', "'scene'"),
        ("Blocks-0000", b"{", b"", ""),
        ("Blocks-0000", b"{", DEEP, "it is nested too deeply"),
    ],
)
def test_a_damaged_record_is_one_line(
    nuscenes_folder: Path, tmp_path: Path, name: str, replaced: bytes, by: bytes, named: str
) -> None:
    shutil.copytree(nuscenes_folder / "out", tmp_path / "out")
    record = tmp_path / f"out/.parts/{name}.json"
    record.write_bytes(record.read_bytes().replace(replaced, by, 1))
    with pytest.raises(InputError, match=rf"\A{tmp_path}/out/\.parts[^\n]*: [^\n]*{named}\Z"):
        export(nuscenes_folder / "set", tmp_path / "out")


@pytest.mark.parametrize("content", [b"{", DEEP, b"[3]"])
def test_damaged_tables_of_another_version_and_records_of_messages_are_left_alone(
    nuscenes_folder: Path, tmp_path: Path, content: bytes
) -> None:
    shutil.copytree(nuscenes_folder / "out", tmp_path / "out")
    (tmp_path / "out/other").mkdir()
    for file in ("other/map.json", ".parts/Blocks-0000.can_bus.json"):
        (tmp_path / "out" / file).write_bytes(content)
    export(nuscenes_folder / "set", tmp_path / "out")
    (tmp_path / "out/other/map.json").unlink()
    assert digest(tmp_path / "out") == digest(nuscenes_folder / "out")


def test_a_damaged_scene_is_named_and_the_others_are_exported(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000")
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0001", number=1)
    file = locate_mcap(tmp_path / "set/scenes/train/Blocks-0001")
    data = bytearray(file.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 100] = bytes(100)
    file.write_bytes(data)
    done = export(tmp_path / "set", tmp_path / "out")
    assert done.scenes == 1 and list(done.failures) == ["Blocks-0001"]
    assert [record["name"] for record in tables_of(tmp_path / "out")["scene"]] == ["Blocks-0000"]


def test_bad_input_is_explained(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "Blocks-0000")
    (tmp_path / "empty/scenes").mkdir(parents=True)
    with pytest.raises(InputError, match="no finished scene"):
        export(tmp_path / "empty", tmp_path / "out")
    (tmp_path / "real/v1.0-trainval").mkdir(parents=True)
    with pytest.raises(InputError, match="simbev has not written"):
        export(tmp_path / "Blocks-0000", tmp_path / "real")


def test_the_command_reports_what_it_made(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "Blocks-0000")
    words = ["export", "nuscenes", str(tmp_path / "Blocks-0000"), "--out", str(tmp_path / "out"), "--all-frames"]
    first, second = (CliRunner().invoke(app, words) for _ in range(2))
    assert "3 samples of 1 scene, 12 files in" in first.output
    assert "1 scene was there already" in second.output


def test_a_finished_part_is_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000")
    inodes: list[int] = []
    monkeypatch.setattr(os, "fsync", lambda descriptor: inodes.append(os.fstat(descriptor).st_ino))
    export(tmp_path / "set", tmp_path / "out")
    paths = [path for path in (tmp_path / "out").rglob("*") if path.name != ".lock"]
    assert len(paths) > 30 and {path.stat().st_ino for path in paths} <= set(inodes)
    order = {path: inodes.index(path.stat().st_ino) for path in paths if path.is_file()}
    head = next(position for path, position in order.items() if path.name.endswith(".head.json"))
    assert head > max(position for path, position in order.items() if path.parts[-3] in ("samples", "sweeps"))
