"""A loopback interface that is down is noticed at once, before processes wait for each other."""

import subprocess
import sys

import pytest

from simbev_ros.foundation.loopback import loopback_problem

APART = ["unshare", "--net"]
"""Runs a command with a network of its own, in which the loopback interface is down."""


def can_be_apart() -> bool:
    try:
        return subprocess.run([*APART, "true"], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


def test_the_interface_of_this_machine_carries_messages() -> None:
    assert loopback_problem() is None


@pytest.mark.skipif(not can_be_apart(), reason="a network of its own needs root and unshare")
def test_an_interface_that_is_down_is_named_with_the_remedy() -> None:
    program = "from simbev_ros.foundation.loopback import require_loopback; require_loopback()"
    done = subprocess.run([*APART, sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.stderr.splitlines()[-1].endswith(
        "InputError: the loopback interface carries no messages to 127.0.0.1 (Network is unreachable); "
        "the graph needs it: ip link set lo up"
    )
