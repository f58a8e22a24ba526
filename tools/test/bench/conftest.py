"""Benchmarks run as one runs them, in the test's own process."""

import sys
from collections.abc import Callable
from typing import NamedTuple

import pytest

from simbev_ros.cli.main import run_app
from tools.bench.cli.group import bench as commands


class Answer(NamedTuple):
    """The result of a command: its exit code and its output."""

    code: int
    out: str
    err: str


@pytest.fixture
def bench(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Answer]:
    """Runs ``python -m tools.bench`` with some arguments."""

    def run(*arguments: object) -> Answer:
        monkeypatch.setattr(sys, "argv", ["bench", *map(str, arguments)])
        monkeypatch.setenv("COLUMNS", "200")
        monkeypatch.setenv("PYTHONSAFEPATH", "")
        with pytest.raises(SystemExit) as ended:
            run_app(commands, "bench")
        return Answer(int(ended.value.code or 0), *capsys.readouterr())

    return run


@pytest.fixture
def refused(bench: Callable[..., Answer]) -> Callable[..., str]:
    """Runs a benchmark with arguments that it must refuse with exit code 2; gives the message."""

    def run(*arguments: object) -> str:
        answer = bench(*arguments)
        assert answer.code == 2
        assert "Traceback" not in answer.err
        return answer.err

    return run
