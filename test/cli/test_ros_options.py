"""ROS's own arguments and namespaces on the command line: who takes them, and what is refused."""

from collections.abc import Callable
from typing import Any

import pytest

REMAPPING = ("--ros-args", "-r", "/a:=/b")


def test_help_calls_the_command_by_its_name(simbev: Any) -> None:
    assert "Usage: simbev run [OPTIONS]" in simbev("run", "--help").out


def test_empty_arguments_of_a_launch_file_are_taken_by_every_verb(simbev: Any) -> None:
    assert simbev("env", "--ros-args").code == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("info", "bag", *REMAPPING), "--ros-args: simbev info takes no arguments for nodes; run, replay and view do"),
        (("run", "live", "--ros-args", "-r", "x"), "--ros-args: Couldn't parse remap rule: '-r x'"),
        (("run", "live", "--namespace", "a b"), "--namespace: 'a b' is not a namespace; allowed: letters, digits"),
        (("run", "live", "--ros-args", "-r", "__ns:=/1a"), "error: --ros-args -r __ns: '/1a' is not a namespace"),
        (("run", "live", "--namespace", "a", "--ros-args", "-r", "__ns:=/b"), "two namespaces: /a and /b"),
        (("replay", "bag", "live", "--out", "o", "--workers", "2", *REMAPPING), "--ros-args: is for one graph"),
        (
            ("replay", "bag", "live", "--out", "o", "--workers", "2", "--namespace", "a"),
            "--namespace: is for one graph",
        ),
        (("view", "foxglove", "bag", "--namespace", "a"), "--namespace: is for the running graph; leave bag out"),
        (("view", "bag", *REMAPPING), "--ros-args: is for running graphs: simbev view live, simbev view foxglove"),
    ],
)
def test_what_cannot_be_is_refused(refused: Callable[..., str], words: tuple[str, ...], message: str) -> None:
    assert message in refused(*words)
