"""Interrupts that arrive where Python drops exceptions."""

import os
import signal
import sys
import time

import pytest
from waiting import PATIENCE_S

from simbev_ros.ros.graph.interrupts import Interrupted, postponing_interrupts, raising_interrupts


class InterruptedWhileDestroyed:
    """An object in whose destructor the user presses Ctrl-C."""

    def __del__(self) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(1.0)


def test_an_interrupt_in_a_destructor_is_raised_after_it() -> None:
    handlers = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)]
    hook = sys.unraisablehook
    with pytest.raises(Interrupted), raising_interrupts():
        dying = InterruptedWhileDestroyed()
        del dying
        time.sleep(PATIENCE_S)  # the interrupt ends it
        raise AssertionError("not interrupted")
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)] == handlers
    assert sys.unraisablehook is hook


def test_an_interrupt_that_c_code_does_not_expect_is_raised_in_place_of_its_error() -> None:
    with pytest.raises(Interrupted), raising_interrupts():
        raise SystemError("returned a result with an exception set") from Interrupted()
    with pytest.raises(SystemError, match="made up"), raising_interrupts():
        raise SystemError("made up") from ValueError()


def test_other_exceptions_of_destructors_are_reported_as_before() -> None:
    class Failing:
        def __del__(self) -> None:
            raise ValueError("made up")

    seen: list[str] = []
    before, sys.unraisablehook = sys.unraisablehook, lambda lost: seen.append(str(lost.exc_value))
    try:
        with raising_interrupts():
            failing = Failing()
            del failing
    finally:
        sys.unraisablehook = before
    assert seen == ["made up"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_postponed_interrupt_is_raised_after_the_step(number: signal.Signals) -> None:
    done: list[str] = []
    with pytest.raises(Interrupted), raising_interrupts():
        with postponing_interrupts():
            os.kill(os.getpid(), number)
            time.sleep(0.05)
            done.append("step")
        done.append("more")
    assert done == ["step"]


def test_interrupts_are_raised_at_once_after_a_step_that_none_has_disturbed() -> None:
    with pytest.raises(Interrupted), raising_interrupts():
        with postponing_interrupts():
            pass
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(PATIENCE_S)
        raise AssertionError("not interrupted")
