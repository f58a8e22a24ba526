"""Whatever stands where a command is to write, it writes only what it should, or says in one line why it does not.

The options are those of the command line itself: a new one that names an output fails here until it has a row.
"""

import os
import socket
import stat
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import evaluated_dataset as made
import numpy as np
import pytest
import typer
from made_up_scene import made_up_scene

from simbev_ros.cli.main import app
from simbev_ros.evaluation.predictions.prediction_writer import write_predictions
from simbev_ros.foundation.errors import SimbevError
from simbev_ros.ros.graph.session import GraphSession

Simbev = Callable[..., Any]
CONFIGURATION = "scenes: [{map: Blocks, train: 1}]\nrig: {sensors: [{type: imu, name: imu}]}\ntraffic: {vehicles: 1}\n"


class Output(NamedTuple):
    """An option that names an output.

    Attributes:
        option: The verb and the option.
        command: A command; OUT is the value of the option.
        place: What it writes.
        makes: What that is.
    """

    option: str
    command: str
    place: str = "OUT"
    makes: str = "folder"


OUTPUTS = (
    Output("demo --out", "demo --out OUT", makes="new"),
    Output("run --record", "run CONFIG --record OUT"),
    Output("run --evaluate", "run CONFIG --evaluate OUT"),
    Output("run --evaluate", "run CONFIG --evaluate OUT.json", "OUT.json", "file"),
    Output("generate --out", "generate CONFIG --retries 0 --out OUT"),
    Output("replay --out", "replay BAG CONFIG --out OUT"),
    Output("replay --evaluate", "replay BAG CONFIG --evaluate OUT.json", "OUT.json", "file"),
    Output("scene --out", "scene CONFIG --workers 1 --out OUT", makes="file"),
    Output("info --report", "info DATASET --workers 1 --no-videos --report OUT"),
    Output("info --report", "info DATASET --workers 1 --no-videos --report OUT", "OUT/index.html", "file"),
    Output("info --report", "info DATASET --workers 1 --no-videos --report OUT", "OUT/index_files"),
    Output("info --report", "info DATASET --workers 1 --no-videos --report OUT.html", "OUT.html", "file"),
    Output("preview --out", "preview BAG --no-video --overwrite --out OUT"),
    Output("preview --out", "preview BAG --overwrite --out OUT", "OUT/Blocks-0000.png", "file"),
    Output("preview --out", "preview BAG --overwrite --out OUT", "OUT/Blocks-0000.mp4", "file"),
    Output("gallery --out", "gallery --map Blocks --out OUT"),
    Output("gallery --out", "gallery --map Blocks --overwrite --out OUT", "OUT/towns.jpg", "file"),
    Output("view recorded --out", "view recorded BAG --out OUT.rrd", "OUT.rrd", "file"),
    Output("repair --out", "repair BAG --out OUT", makes="new"),
    Output("evaluate --report", "evaluate PREDICTED EVALUATED --workers 1 --report OUT", makes="file"),
    Output("evaluate --json", "evaluate PREDICTED EVALUATED --workers 1 --json OUT", makes="file"),
    Output("drive suite --out", "drive suite --stack none --routes 1 --out OUT"),
    Output("drive suite --report", "drive suite --stack none --routes 1 --out RUN --report OUT", makes="file"),
    Output("drive suite --json", "drive suite --stack none --routes 1 --out RUN --json OUT", makes="file"),
    Output("realism --report", "realism DATASET --against FRAMES --report OUT", makes="file"),
    Output("map --out", "map Blocks --out OUT.png", "OUT-above.png", "file"),
    Output("map --out", "map Blocks --check --out OUT.png", "OUT-check.png", "file"),
    Output("map --to", "map Blocks --to OUT.xodr", "OUT.xodr", "file"),
    Output("map --to", "map Blocks --to OUT/lanelet2_map.osm", "OUT/map_projector_info.yaml", "file"),
    Output("export simbev --out", "export simbev DATASET --workers 1 --out OUT"),
    Output("export simbev --out", "export simbev DATASET --workers 1 --out OUT", "OUT/simbev"),
    Output("export autoware --out", "export autoware DATASET --out OUT"),
    Output("export coco --out", "export coco DATASET --workers 1 --out OUT"),
    Output("export kitti --out", "export kitti DATASET --workers 1 --out OUT"),
    Output("export nuscenes --out", "export nuscenes DATASET --workers 1 --out OUT"),
    Output("export opv2v --out", "export opv2v DATASET --workers 1 --out OUT"),
    Output("export osi --out", "export osi DATASET --workers 1 --out OUT"),
    Output("export t4 --out", "export t4 DATASET --workers 1 --out OUT"),
    Output("export yolo --out", "export yolo DATASET --workers 1 --out OUT"),
    Output("train --out", "train lidar DATASET --workers 1 --out OUT"),
    Output("train --cache", "train lidar DATASET --workers 1 --out RUN --cache OUT"),
    Output("predict --out", "predict lidar DATASET --workers 1 --out OUT"),
    Output("predict --out", "predict lidar FRAMES --format folder --out OUT", makes="new"),
    Output("predict --cache", "predict lidar DATASET --workers 1 --out RUN --cache OUT"),
)
INPUTS = {"realism --against"}
"""Options that name what is read."""
KINDS = {
    *("nothing", "file", "folder", "link to file", "link to folder", "dangling link", "looped link"),
    *("pipe", "device", "socket", "below a file", "long name", "name of two lines"),
}
REFUSED = {
    "file": KINDS - {"nothing", "file", "device", "pipe", "name of two lines"},
    "folder": KINDS - {"nothing", "folder", "link to folder", "name of two lines"},
    "new": KINDS - {"nothing", "name of two lines"},
}
"""Kinds of things in place of which nothing is made, by what the command makes; a pipe may have a reader."""


def options_of(command: Any, words: tuple[str, ...] = ()) -> Iterator[str]:
    """Verbs with their options that name a path, or are called --out."""
    if hasattr(command, "list_commands"):
        for name in command.list_commands(None):
            yield from options_of(command.get_command(None, name), (*words, name))
        return
    for each in command.params:
        kind = getattr(each.type_descriptor.annotation, "__name__", "")
        if each.param_type_name == "option" and (kind == "Path" or "--out" in each.opts):
            yield " ".join((*words, each.opts[0]))


@pytest.mark.usefixtures("training")
def test_every_option_that_names_an_output_has_a_row() -> None:
    found = {*options_of(typer.main.get_command(app))}
    assert {each.option for each in OUTPUTS} == found - INPUTS


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "good.yaml").write_text(CONFIGURATION)
    bag = folder / "set/scenes/train/Blocks-0000"
    made_up_scene(bag, ticks=2)
    write_predictions(folder / "boxes.parquet", [(made.NAMES[0], made.as_predicted())])
    (folder / "frames").mkdir()
    np.full((40, 4), 3.0, np.float32).tofile(folder / "frames/000000.bin")
    names = {"FRAMES": "frames", "PREDICTED": "boxes.parquet", "CONFIG": "good.yaml", "DATASET": "set"}
    return {name: folder / path for name, path in names.items()} | {"BAG": bag, "EVALUATED": made.record(folder / "b")}


@pytest.fixture(autouse=True)
def _work_only_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    def begin(*_: object, **__: object) -> None:
        raise SimbevError("the work, which takes long, begins")

    monkeypatch.setattr(GraphSession, "__init__", begin)
    monkeypatch.setattr("simbev_ros.cli.gallery_pictures.load_roads", begin)
    monkeypatch.setattr("simbev_ros.cli.map.exploration.load_network", begin)
    monkeypatch.setattr("simbev_ros.cli.scene.sheet.draw_scene_with_map", begin)


def put(kind: str, place: Path, folder: Path) -> None:
    """Put something where a command is to write, and things that are not to be written beside it, into a folder."""
    (precious := folder / "precious").mkdir(parents=True)
    (precious / "folder").mkdir()
    (folder / "at").mkdir()
    for each in (precious / "mine", precious / "folder/mine", folder / "at/file"):
        each.write_bytes(b"mine")
    if kind not in ("below a file", "long name"):
        place.parent.mkdir(parents=True, exist_ok=True)
    match kind:
        case "file":
            place.write_bytes(b"mine")
        case "folder":
            place.mkdir()
            (place / "mine").write_bytes(b"mine")
        case "link to file" | "link to folder" | "dangling link" | "looped link":
            name = {"link to file": "mine", "link to folder": "folder"}.get(kind, "nothing")
            place.symlink_to(place if kind == "looped link" else precious / name)
        case "pipe":
            os.mkfifo(place)
        case "device":
            os.mknod(place, stat.S_IFCHR | 0o666, os.makedev(1, 3))
        case "socket":
            here = Path.cwd()
            os.chdir(place.parent)  # addresses are short
            with socket.socket(socket.AF_UNIX) as server:
                server.bind(place.name)
            os.chdir(here)


def things(folder: Path) -> dict[str, tuple[Any, ...]]:
    """All that is below a folder: kind, device, inode and target of a link; the content of a regular file."""
    found: dict[str, tuple[Any, ...]] = {}
    for path in folder.rglob("*"):
        status = path.lstat()
        kind = stat.S_IFMT(status.st_mode)
        content: Any = path.read_bytes() if stat.S_ISREG(status.st_mode) else (status.st_rdev, status.st_ino)
        found[str(path)] = kind, content, str(path.readlink()) if path.is_symlink() else ""
    return found


def name_of(kind: str) -> str:
    return {"below a file": "file/x", "long name": "x" * 300, "name of two lines": "a\nb"}.get(kind, "x")


SLOW = ("train", "predict")
"""Verbs whose libraries take long to load."""
each_output = pytest.mark.parametrize(
    "output",
    [pytest.param(each, marks=[pytest.mark.slow] * each.option.startswith(SLOW)) for each in OUTPUTS],
    ids=lambda each: f"{each.option} {each.place}",
)


@each_output
def test_what_no_output_replaces_is_refused_before_any_work(
    simbev: Simbev, inputs: dict[str, Path], tmp_path: Path, output: Output
) -> None:
    require_no_faults(simbev, output, REFUSED[output.makes], inputs, tmp_path)


@pytest.mark.slow
@each_output
def test_only_the_output_is_written(simbev: Simbev, inputs: dict[str, Path], tmp_path: Path, output: Output) -> None:
    require_no_faults(simbev, output, KINDS - REFUSED[output.makes], inputs, tmp_path)


def require_no_faults(
    simbev: Simbev, output: Output, kinds: Collection[str], inputs: dict[str, Path], folder: Path
) -> None:
    faults = []
    for number, kind in enumerate(sorted(kinds)):
        if kind != "device" or os.getuid() == 0:  # others may not make one
            faults += [f"{kind}: {fault}" for fault in faults_of(simbev, output, kind, inputs, folder / str(number))]
    assert not faults, "\n".join(faults)


def faults_of(simbev: Simbev, output: Output, kind: str, inputs: dict[str, Path], folder: Path) -> Iterator[str]:
    """Run a command where something of a kind is in the place of its output; yield what is wrong."""
    value = folder / "at" / name_of(kind)
    place = Path(output.place.replace("OUT", str(value)))
    put(kind, place, folder)
    before = things(folder)
    answer = simbev(*words_of(output.command, {**inputs, "OUT": value, "RUN": folder / "at/run"}))
    after = things(folder)
    replaced = str(place) if output.makes == kind == "file" else ""
    for path in before:
        if path != replaced and after.get(path) != before[path]:
            yield f"{path} is not what it was: {answer}"
    error = answer.err.strip().replace(value.name, "")
    if "bug" in error or "Traceback" in error or (answer.code and "\n" in error):
        yield f"no line for users: {answer}"
    if answer.code != 2 and kind in REFUSED[output.makes]:
        yield f"is not refused: {answer}"
    made = {path for path in after.keys() - before.keys() if not path.endswith("/.lock")}
    if made and answer.code == 2 and kind in REFUSED[output.makes]:
        yield f"is refused, but leaves {made}: {answer}"


def words_of(command: str, values: dict[str, Path]) -> list[str]:
    """The words of a command with values in place of the capitals."""
    for name, value in values.items():
        command = command.replace(name, f"\0{value}\0")
    return [word.replace("\0", "") for word in command.split(" ")]
