"""Reading, checking, evaluating and exporting work with the base installation, also where Python is not Linux's.

Programs run without the modules of all extras, and without what macOS and Windows lack.
"""

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from made_up_scene import SENSORS, made_up_spec, record_made_up

from simbev_ros.cli.main import VERBS
from simbev_ros.foundation.installation.extras import load_extras
from simbev_ros.schema.views import VIEW_DTYPE

PACKAGE = Path(__file__).parents[2] / "simbev_ros"
OF_LINUX = ("fcntl", "grp", "msvcrt", "pty", "pwd", "resource", "termios", "tty")
NAMES_OF_LINUX = {
    "os": ("O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK", "fork", "getuid", "sched_getaffinity", "sysconf"),
    "signal": ("SIGALRM", "SIGHUP", "pthread_sigmask", "setitimer"),
}
OF_EXTRAS = sorted({module for extra in load_extras().values() for module in extra.modules})
ROOMS = ("schema", "recording", "dataset", "evaluation", "export")
NEED_MORE = ("dataset/torch_dataset", "export/maps", "export/nuscenes/map_", "evaluation/driving", "evaluation/live")
"""Modules that need PyTorch, maps or ROS, which none of the others imports before it is needed."""
NOT_LOADED = (
    *("cv2", "scipy", "shapely", "PIL", "plotly", "pandas"),
    *(f"simbev_ros.{room}" for room in ("maps", "scene", "assets", "simulation", "ros", "show", "production", "cli")),
)
"""What reading a frame must not load: it would take longer than the frame."""


def bare_python(program: str, *, all_platforms: bool = True) -> str:
    """What a program prints that runs without the modules of extras, and without what only some platforms have."""
    lines = ["import os, signal, sys", f"sys.modules.update(dict.fromkeys({OF_EXTRAS!r}))"]
    if all_platforms:
        lines += [f"sys.modules.update(dict.fromkeys({OF_LINUX!r}))"]
        lines += [f"for name in {names!r}: delattr({module}, name)" for module, names in NAMES_OF_LINUX.items()]
    command = [sys.executable, "-c", "\n".join([*lines, program])]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr
    return answer.stdout


def simbev(*calls: Sequence[str], all_platforms: bool) -> list[tuple[int, str, str]]:
    """Exit code, output and errors of calls of the command, one after the other in one process."""
    program = f"""
import contextlib, io, json
from simbev_ros.cli.main import main
answers = []
for words in {calls!r}:
    sys.argv = ["simbev", *words]
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        try:
            main()
        except SystemExit as ended:
            answers.append((ended.code or 0, out.getvalue(), err.getvalue()))
print(json.dumps(answers))
"""
    return [(code, out, err) for code, out, err in json.loads(bare_python(program, all_platforms=all_platforms))]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("light")
    nothing_seen = {"/ego/cam_front/boxes": np.zeros(0, VIEW_DTYPE)}
    record_made_up(folder / "scenes/train/Blocks-0000", made_up_spec(SENSORS, ticks=13), tables=nothing_seen)
    return folder


def test_every_module_on_the_way_is_imported_without_extras_and_on_any_platform() -> None:
    paths = sorted(
        path.relative_to(PACKAGE).with_suffix("") for room in ROOMS for path in (PACKAGE / room).rglob("*.py")
    )
    modules = [path.as_posix() for path in paths if not path.as_posix().startswith(NEED_MORE)]
    program = "import importlib\n" + "\n".join(
        f"importlib.import_module('simbev_ros.{module.replace('/', '.').removesuffix('.__init__')}')"
        for module in modules
    )
    assert len(modules) > 100
    bare_python(program)


def test_a_frame_is_read_without_loading_what_makes_scenes(dataset: Path) -> None:
    program = f"""
from simbev_ros.dataset import open_dataset
frame = open_dataset({str(dataset)!r}).scenes[0][2]
print(*frame.load())
print(*sys.modules)
"""
    keys, modules = (set(line.split()) for line in bare_python(program).splitlines())
    assert {"cam_front/rgb", "cam_front/depth", "cam_front/flow", "lidar/points", "boxes"} <= keys
    assert {
        name for name in NOT_LOADED if any(f"{each}.".startswith(f"{name}.") for each in modules - {*OF_EXTRAS})
    } == set()


def test_verbs_that_read_work_on_any_platform(dataset: Path) -> None:
    bag = str(dataset / "scenes/train/Blocks-0000")
    helps = [[verb, "--help"] for verb in VERBS]
    calls = [["--help"], ["info", str(dataset)], ["info", bag, "--digest"], ["verify", bag], ["doctor"], *helps]
    answers = simbev(*calls, all_platforms=True)
    failures = {" ".join(words): answer for words, answer in zip(calls, answers, strict=True) if answer[0]}
    assert set(failures) == {f"verify {bag}"}
    assert "1 fault in 1 bag" in failures[f"verify {bag}"][1], "made up without counts"


def test_exports_work(dataset: Path, tmp_path: Path) -> None:
    layouts = ("simbev", "nuscenes", "opv2v", "coco", "yolo", "kitti")
    calls = [["export", name, str(dataset), "--out", str(tmp_path / name), "--workers", "1"] for name in layouts]
    answers = simbev(*calls, all_platforms=False)  # files are locked by a module that is another one on Windows
    assert [answer[0] for answer in answers] == [0] * len(layouts), answers
    assert "masks of maps are empty" in answers[1][1].replace("\n", " ") and "[sim]'" in answers[1][1]
    assert [path.suffix for path in (tmp_path / "nuscenes/maps").iterdir()] == [".png"]


def test_what_a_verb_lacks_is_said_in_one_line_with_the_remedy(dataset: Path, tmp_path: Path) -> None:
    out = str(tmp_path / "out")
    uses = {
        ("demo",): "simbev demo needs the simulator and ROS 2 Jazzy",
        ("run", "demo"): "simbev run needs the simulator and ROS 2 Jazzy",
        ("generate", "demo", "--out", out): "simbev generate needs the simulator and ROS 2 Jazzy",
        ("map", "Blocks"): "simbev map needs the simulator",
        (
            "preview",
            str(dataset / "scenes/train/Blocks-0000"),
            "--out",
            out,
        ): "this needs the libraries that draw pictures",
        ("evaluate", "predictions", str(dataset), "--report", f"{out}.html"): (
            "simbev evaluate --report needs the libraries that draw pictures"
        ),
        ("info", str(dataset), "--report", out): "simbev info --report needs the simulator",
    }
    for use, (code, _, error) in zip(uses.values(), simbev(*uses, all_platforms=False), strict=True):
        assert code == 2
        pronoun = "them" if " and " in use else "it"
        assert error.startswith(f"error: {use}; install {pronoun}: {sys.executable} -m pip install ")
        assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_drives_need_the_simulators_libraries_and_say_so(dataset: Path) -> None:
    [(code, _, err)] = simbev(["evaluate", str(dataset)], all_platforms=False)
    assert (
        code == 2 and err.startswith("error: ") and "this needs the simulator" in err and len(err.splitlines()) == 1
    ), err
