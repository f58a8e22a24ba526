"""``simbev view --live`` and ``--view`` refuse what does not go together, in one line, before anything starts."""

import os
import socket
from collections.abc import Callable
from typing import Any

import pytest

from simbev_ros.ros.graph.environment import graph_environment

pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["out/demo"], "out/demo"),
        (["--scene", "3"], "--scene 3"),
        (["--out", "file.rrd"], "--out file.rrd"),
    ],
)
def test_a_running_graph_is_no_recording(refused: Callable[..., str], words: list[str], named: str) -> None:
    message = refused("view", "--live", *words)
    assert message == f"error: {named}: --live shows a running graph; give one or the other\n"


@pytest.mark.parametrize("words", [["--domain", "3"], ["--network"], ["--rate", "2.0"]])
def test_options_of_running_graphs_are_not_for_recordings(refused: Callable[..., str], words: list[str]) -> None:
    assert refused("view", "out/demo", *words) == f"error: {' '.join(words)}: is for --live\n"


def test_a_domain_that_is_none_is_named(refused: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "many")
    assert refused("view", "--live") == "error: ROS_DOMAIN_ID: must be a number from 0 to 232, not 'many'\n"


def test_a_viewers_port_needs_a_viewer(refused: Callable[..., str], no_graph: Any) -> None:
    assert refused("run", "demo", "--view-port", 0) == "error: --view-port 0: is for --view\n"


@pytest.mark.usefixtures("no_graph")
@pytest.mark.parametrize(
    ("words", "option"),
    [(["run", "demo", "--view", "--view-port"], "--view-port"), (["view", "--live", "--port"], "--port")],
)
def test_a_taken_port_is_named(
    refused: Callable[..., str], monkeypatch: pytest.MonkeyPatch, words: list[str], option: str
) -> None:
    for name in graph_environment(0):  # which the command sets for its own process
        monkeypatch.setenv(name, os.environ.get(name, ""))
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        message = refused(*words, port)
    words_of_system = "cannot be listened on: address already in use"
    assert message == f"error: {option} {port}: 127.0.0.1:{port} {words_of_system}; 0 takes any free port\n"
