"""``simbev view live`` and ``--view`` refuse what does not go together, in one line, before anything starts."""

import os
import socket
from collections.abc import Callable
from typing import Any

import pytest

from simbev_ros.ros.graph.environment import graph_environment

pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["live", "out/demo"], "Got unexpected extra argument"),
        (["live", "--scene", "3"], "No such option: --scene"),
        (["out/demo", "--domain", "3"], "No such option: --domain"),
        (["foxglove", "out/demo", "--domain", "3"], "error: --domain: is for the running graph; leave out/demo out"),
        (["foxglove", "out/demo", "--network"], "error: --network: is for the running graph; leave out/demo out"),
        (["foxglove", "--scene", "3"], "error: --scene 3: is for a recorded scene; give its bag or dataset"),
    ],
)
def test_recordings_and_running_graphs_have_options_of_their_own(
    refused: Callable[..., str], words: list[str], message: str
) -> None:
    assert message in refused("view", *words)


def test_a_domain_that_is_none_is_named(refused: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "many")
    assert refused("view", "live") == "error: ROS_DOMAIN_ID: must be a number from 0 to 232, not 'many'\n"


def test_a_viewers_port_needs_a_viewer(refused: Callable[..., str], no_graph: Any) -> None:
    assert refused("run", "demo", "--view-port", 0) == "error: --view-port 0: is for --view\n"


@pytest.mark.usefixtures("no_graph")
@pytest.mark.parametrize(
    ("words", "option"),
    [(["run", "demo", "--view", "--view-port"], "--view-port"), (["view", "live", "--port"], "--port")],
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
    assert message == f"error: {option}: 127.0.0.1:{port} {words_of_system}; 0 takes any free port\n"
