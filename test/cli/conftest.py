"""Commands run as a user runs them, in the test's own process."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from fake_distribution import announce

from simbev_ros.cli.main import main
from simbev_ros.ros.graph.session import GraphSession


class Answer(NamedTuple):
    """The result of a command: its exit code and its output."""

    code: int
    out: str
    err: str


@pytest.fixture
def simbev(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Answer]:
    """Runs ``simbev`` with some arguments."""

    def run(*arguments: object) -> Answer:
        monkeypatch.setattr(sys, "argv", ["simbev", *map(str, arguments)])
        monkeypatch.setenv("COLUMNS", "200")
        with pytest.raises(SystemExit) as ended:
            main()
        return Answer(int(ended.value.code or 0), *capsys.readouterr())

    return run


@pytest.fixture
def refused(simbev: Callable[..., Answer]) -> Callable[..., str]:
    """Runs ``simbev`` with arguments that it must refuse with exit code 2; gives the message."""

    def run(*arguments: object) -> str:
        answer = simbev(*arguments)
        assert answer.code == 2
        assert "Traceback" not in answer.err
        return answer.err

    return run


@pytest.fixture
def no_graph(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the start of a graph a failure, where everything wrong must be found before."""

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("the graph was started")

    monkeypatch.setattr(GraphSession, "start", refuse)


@pytest.fixture
def training(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """The verbs of simbev_training, as if it were installed."""
    announce(Path(__file__).parents[2] / "training", tmp_path_factory.mktemp("site"), monkeypatch)
