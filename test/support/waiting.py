"""Waits of the tests for conditions: a test of real processes waits for what it means, never for a time."""

import time
from collections.abc import Callable

PATIENCE_S = 150.0
"""Limit of a wait. It only matters when a test fails, so it allows for a machine that is busy with other work."""


def _sleep() -> None:
    time.sleep(0.02)


def wait_until(
    condition: Callable[[], object], timeout_s: float = PATIENCE_S, *, meanwhile: Callable[[], object] = _sleep
) -> None:
    """Wait until a condition holds; fail when the time is over.

    Args:
        condition: The condition.
        timeout_s: The limit; a shorter one shows that something does not happen.
        meanwhile: Called between two looks at the condition, such as to spin a node; it takes a moment.
    """
    end_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end_s, "timed out"
        meanwhile()
