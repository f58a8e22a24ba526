"""Messages show names as they are, and errors of the machine are not shown as bugs."""

import errno
import os
import re
import resource
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.table import Table

from simbev_ros.cli import console, main
from simbev_ros.cli.console import counting_bar, make_console, percent_bar


def test_strings_are_no_markup_and_no_emoji() -> None:
    name, out = "[/nope] [red]x[/red] :smile:", StringIO()
    shown = make_console(file=out, width=200, force_terminal=True, no_color=True)
    table = Table(name, title=name)
    table.add_row(name)
    shown.print(name, highlight=False)
    shown.print(table)
    with counting_bar(name, shown) as bar:
        bar.describe(name)
    with percent_bar(name, shown):
        pass
    assert re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", out.getvalue()).count(name) >= 6


def test_all_consoles_of_the_command_line_are_made_in_one_place() -> None:
    home = Path(console.__file__)
    making = {path.name for path in home.parent.rglob("*.py") if re.search(r"\bConsole\(", path.read_text())}
    assert making <= {home.name}


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (
            OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG), "x" * 5000),
            2,
            f"{'x' * 300}: File name too long",
        ),
        (OSError(errno.EACCES, "Permission denied", b"/caf\xe9"), 2, "/caf\\udce9: Permission denied"),
        (
            OSError(errno.EMFILE, "Too many open files", "/a"),
            1,
            "/a: too many files are open: ulimit -n allows 4096 open files; ulimit -n 16384 helps",
        ),
        (OSError(errno.ENOSPC, "No space left on device"), 1, "the disk is full"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), 1, "memory ran out"),
        (MemoryError(), 1, "memory ran out"),
        (
            ImportError("libGL.so.1: cannot open"),
            1,
            "libGL.so.1: cannot open; simbev doctor says what this machine lacks",
        ),
    ],
)
def test_errors_of_the_machine_are_said_in_one_line(
    simbev: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, error: Exception, code: int, message: str
) -> None:
    def fail(**_: object) -> None:
        raise error

    for name in ("LD_PRELOAD", "LD_LIBRARY_PATH"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(main, "app", fail)
    limits = {resource.RLIMIT_NOFILE: (4096, 4096)}
    monkeypatch.setattr(resource, "getrlimit", lambda kind: limits.get(kind, (resource.RLIM_INFINITY,) * 2))
    answer = simbev("doctor")
    assert (answer.code, answer.err) == (code, f"error: {message}\n")


def test_a_library_that_does_not_load_names_the_variable_that_led_to_it(
    simbev: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(**_: object) -> None:
        try:
            raise ImportError("/my/lib/libstdc++.so.6: file too short")
        except ImportError as cause:
            raise ImportError("many\nlines of advice") from cause

    monkeypatch.setenv("LD_LIBRARY_PATH", "/my/lib")
    monkeypatch.setattr(main, "app", fail)
    answer = simbev("info")
    assert answer.code == 2
    assert answer.err.startswith("error: /my/lib/libstdc++.so.6: file too short; LD_LIBRARY_PATH=/my/lib: ")
    assert "unset it" in answer.err and answer.err.count("\n") == 1
