"""Whatever a file, output or number on the command line is, the answer is one message; nothing waits or is made."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from made_up_scene import made_up_scene

pytestmark = pytest.mark.usefixtures("no_graph")


Simbev = Callable[..., Any]

GOOD = """scenes: [{map: Blocks, train: 1}]
rig: {sensors: [{type: imu, name: imu}]}
traffic: {vehicles: 1, pedestrians: 1}
"""
FILES = [
    "run FILE",
    "generate FILE --out OUT",
    "scene FILE",
    "replay FILE CONFIG",
    "replay BAG FILE",
    "info FILE",
    "logs FILE 0",
    "preview FILE --out OUT",
    "verify FILE",
    "repair FILE --out OUT",
    "evaluate FILE DATASET",
    "evaluate DATASET FILE",
    "map FILE",
    "export simbev FILE --out OUT",
    "export nuscenes FILE --out OUT",
    "bench FILE",
]
OUTPUTS = [
    "demo --out OUT",
    "run CONFIG --record OUT",
    "run CONFIG --evaluate OUT",
    "generate CONFIG --out OUT",
    "generate CONFIG --out OUT --dry-run",
    "replay BAG CONFIG --out OUT",
    "preview BAG --out OUT",
    "gallery --out OUT",
    "repair BAG --out OUT/bag",
    "map Town10HD --out OUT/picture.png",
    "info DATASET --report OUT/report.html",
    "info DATASET --report OUT",
    "scene CONFIG --out OUT/scenes.html",
    "evaluate DATASET DATASET --json OUT/figures.json",
    "export simbev DATASET --out OUT",
    "export nuscenes DATASET --out OUT",
]
NUMBERS = [
    "demo --seed NUMBER --out OUT",
    "run demo --domain NUMBER",
    "generate demo --out OUT --retries NUMBER",
    "generate demo --out OUT --replace NUMBER",
    "generate demo --out OUT --workers NUMBER --dry-run",
    "scene demo --count NUMBER",
    "info BAG --workers NUMBER",
    "logs DATASET NUMBER",
    "preview BAG --frame NUMBER --out OUT",
    "gallery --seed NUMBER --out OUT",
    "evaluate DATASET DATASET --every NUMBER",
    "evaluate DATASET DATASET --points NUMBER",
    "evaluate DATASET DATASET --range NUMBER:",
    "map Blocks --seed NUMBER",
    "map Blocks --at NUMBER 0",
    "view live --no-open --domain NUMBER",
    "view live --no-open --rate NUMBER",
    "view live --no-open --port NUMBER",
    "run demo --view --view-port NUMBER",
    "bench --ticks NUMBER",
    "export nuscenes DATASET --out OUT --keyframe-hz NUMBER",
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a good configuration, a dataset and things that are none."""
    folder = tmp_path_factory.mktemp("bad")
    (folder / "good.yaml").write_text(GOOD)
    made_up_scene(folder / "set/scenes/train/Blocks-0000", ticks=2)
    os.mkfifo(folder / "pipe")
    os.mkfifo(folder / "pipe.parquet")
    (folder / "loop").symlink_to("loop")
    for name in (b"binary", b"caf\xe9.osm", b"[red].yaml", b"[red].osm", b"empty.mcap"):
        (folder / os.fsdecode(name)).write_bytes(b"" if b"empty" in name else bytes(range(256)))
    (folder / "[").mkdir()
    (folder / "[/no]").write_bytes(b"[")
    return folder


def arguments(command: str, folder: Path, **values: object) -> list[str]:
    """The words of a command with the paths of a folder and some values in place of the capitals."""
    known = {
        "CONFIG": folder / "good.yaml",
        "DATASET": folder / "set",
        "BAG": folder / "set/scenes/train/Blocks-0000",
        **values,
    }
    for name, value in known.items():
        command = command.replace(name, f"\0{value}\0")
    return [word.replace("\0", "") for word in command.split(" ")]


@pytest.mark.parametrize("command", FILES)
def test_a_bad_file_is_refused(simbev: Simbev, folder: Path, tmp_path: Path, command: str) -> None:
    names = (
        "pipe",
        "pipe.parquet",
        "loop",
        "binary",
        "caf\udce9.osm",
        "[red].yaml",
        "[/no]",
        "empty.mcap",
    )
    for bad in (*(folder / name for name in names), "x" * 5000, "/proc/self/mem", "/dev/zero", "~nobody/x.osm"):
        answer = simbev(*arguments(command, folder, FILE=bad, OUT=tmp_path / "out"))
        assert (answer.code, "this is a bug" in answer.err) in ((2, False), (1, False)), (bad, answer)
        assert answer.code == 2 or command.startswith("verify"), (bad, answer)
        assert answer.out or "error: " in answer.err or "Error" in answer.err
        is_begun = command.startswith("export")  # content is read when the folder is held
        assert is_begun or not (tmp_path / "out").exists(), (bad, answer)


@pytest.mark.parametrize("command", OUTPUTS)
def test_an_output_that_cannot_be_written_is_refused_before_any_work(
    simbev: Simbev, folder: Path, command: str
) -> None:
    before = sorted(folder.rglob("*"))
    for bad in ("/proc", folder / "good.yaml", folder / "good.yaml/x", folder / "loop", "x" * 5000, "/dev/null"):
        answer = simbev(*arguments(command, folder, OUT=bad))
        assert answer.code == 2 and "this is a bug" not in answer.err, (bad, answer)
    assert sorted(folder.rglob("*")) == before


@pytest.mark.parametrize("command", NUMBERS)
def test_a_bad_number_is_refused(simbev: Simbev, folder: Path, tmp_path: Path, command: str) -> None:
    for bad in ("nan", "inf", "-1", "1" + "0" * 30, "1" * 5000, "x", "", "[/no]"):
        answer = simbev(*arguments(command, folder, NUMBER=bad, OUT=tmp_path / "out"))
        assert answer.code in (0, 2) and "this is a bug" not in answer.err, (bad, answer)
        assert not (tmp_path / "out").exists(), (bad, answer)
