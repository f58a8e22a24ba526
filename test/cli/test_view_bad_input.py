"""``simbev view`` answers bad input with one line and exit code 2."""

import re
import socket
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from made_up_scene import made_up_scene

from simbev_ros.foundation.installation.extras import install_command

pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("viewed") / "Blocks-0000"
    made_up_scene(path)
    return path


def test_where_ros_needs_numpy_1_the_reason_is_named(
    refused: Callable[..., str], bag: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("simbev_ros.cli.view.recorded.version", lambda name: "1.26.4")
    message = refused("view", bag)
    assert "needs NumPy 2" in message and "call it where no ROS is sourced, or simbev view foxglove" in message


def test_without_a_path_the_help_names_all_views(simbev: Callable[..., tuple[int, str, str]]) -> None:
    shown = "".join(simbev("view")[1:])
    assert all(name in shown for name in ("recorded", "live", "foxglove", "simbev view BAG shows a recorded one"))


def test_a_missing_path_is_named(refused: Callable[..., str], tmp_path: Path) -> None:
    assert refused("view", tmp_path / "none") == f"error: {tmp_path / 'none'}: no such file or folder\n"


def test_a_folder_without_a_bag_is_named(refused: Callable[..., str], tmp_path: Path) -> None:
    message = f"error: {tmp_path}: a scene's bag holds one .mcap file, this folder holds 0"
    assert refused("view", tmp_path) == f"{message}; a dataset holds a folder scenes\n"


def test_a_file_that_is_no_bag_is_named(refused: Callable[..., str], tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    file.write_bytes(b"nothing")
    assert re.fullmatch(rf"error: {re.escape(str(file))}: not an MCAP file.*\n", refused("view", file))


def test_a_dataset_without_a_scene_is_named(refused: Callable[..., str], tmp_path: Path) -> None:
    (tmp_path / "scenes").mkdir()
    assert refused("view", tmp_path) == f"error: {tmp_path}: the dataset holds no finished scene\n"


def test_an_unknown_scene_is_named_with_those_that_are_there(refused: Callable[..., str], bag: Path) -> None:
    assert refused("view", bag, "--scene", "Town01") == f"error: --scene 'Town01': {bag} has Blocks-0000\n"


def test_a_file_needs_the_suffix_of_rerun(refused: Callable[..., str], bag: Path, tmp_path: Path) -> None:
    out = tmp_path / "scene.mp4"
    assert refused("view", bag, "--out", out) == f"error: --out {out}: must end in .rrd\n"
    assert not out.exists()


def test_a_file_in_a_missing_folder_is_refused(refused: Callable[..., str], bag: Path, tmp_path: Path) -> None:
    out = tmp_path / "none" / "scene.rrd"
    assert refused("view", bag, "--out", out) == f"error: {out}: there is no folder {out.parent}\n"
    assert not out.parent.exists()


def test_a_port_in_use_is_named(refused: Callable[..., str], bag: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        message = refused("view", bag, "--port", port)
    words = "cannot be listened on: address already in use; 0 takes any free port"
    assert message == f"error: --port: 127.0.0.1:{port} {words}\n"


@pytest.mark.parametrize("address", ["192.0.2.1", "2001:db8::1"])
def test_an_address_of_another_machine_is_named(refused: Callable[..., str], bag: Path, address: str) -> None:
    message = refused("view", bag, "--port", 0, "--bind", address)
    assert re.fullmatch(
        rf"error: --bind: {address} cannot be listened on: .*; must be an address of this machine\n", message
    )


def test_an_empty_address_does_not_open_all_interfaces(refused: Callable[..., str], bag: Path) -> None:
    message = refused("view", bag, "--port", 0, "--bind", "")
    assert message == "error: --bind: '': must be an address of this machine\n"


@pytest.mark.parametrize("options", [[], ["--out", "scene.rrd"]])
def test_without_rerun_one_line_says_how_to_install_it(
    refused: Callable[..., str], monkeypatch: pytest.MonkeyPatch, bag: Path, options: list[str]
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    message = refused("view", bag, *options)
    assert message == f"error: simbev view needs Rerun; install it: {install_command('view')}\n"


def test_a_dataset_in_place_of_a_scene_is_told_its_scenes(refused: Callable[..., str], tmp_path: Path) -> None:
    (tmp_path / "set/scenes/train/Blocks-0000").mkdir(parents=True)
    message = f"{tmp_path}/set: is a dataset; name one of its scenes, such as {tmp_path}/set/scenes/train/Blocks-0000"
    assert message in refused("preview", tmp_path / "set")
