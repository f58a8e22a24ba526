"""Where there is no terminal, long work prints a line from time to time; help begins as the command was called."""

import io
from typing import Any

import pytest
from rich.console import Console
from waiting import wait_until

from simbev_ros.cli import console as console_module
from simbev_ros.cli.console import counting_bar, make_console
from simbev_ros.cli.demo import demo
from simbev_ros.cli.plugins import click_command


def wait_for_line(console: Console) -> str:
    """The first line that is printed into a console's file."""
    file: Any = console.file
    wait_until(lambda: "\n" in file.getvalue())
    return str(file.getvalue().splitlines()[0])


@pytest.fixture
def pipe(monkeypatch: pytest.MonkeyPatch) -> Console:
    monkeypatch.setattr(console_module, "_REPORT_PERIOD_S", 0.01)
    return make_console(file=io.StringIO())


def test_a_bar_is_a_line_from_time_to_time(pipe: Console) -> None:
    with counting_bar("frames", pipe, 40) as bar:
        bar.show(7)
        assert wait_for_line(pipe) == "frames: 7 of 40, 0 s"


def test_a_spinner_is_a_line_from_time_to_time(pipe: Console) -> None:
    with pipe.status("roads of Town04"):
        assert wait_for_line(pipe) == "roads of Town04: 0 s"


def test_short_work_prints_nothing() -> None:
    console = make_console(file=io.StringIO())
    with console.status("roads"), counting_bar("frames", console, 4) as bar:
        bar.advance()
    file: Any = console.file
    assert not file.getvalue().strip()


def test_examples_begin_as_the_command_was_called(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "\nsimbev demo --seed" in click_command("demo", demo).help
    monkeypatch.setenv("SIMBEV_COMMAND", "./simbev")
    assert "\n./simbev demo --seed" in click_command("demo", demo).help
