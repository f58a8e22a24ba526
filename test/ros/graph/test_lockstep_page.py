"""The Python samples of the lockstep page, exactly as printed, take part in one graph, each with a name of its own."""

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from commands import Simbev

pytestmark = pytest.mark.graph

PAGE = (Path(__file__).parents[3] / "docs/tutorials/your-stack-in-lockstep.md").read_text(encoding="utf-8")
CLOUDS = 40
PARTICIPANTS = "graph: {participants: [my_stack]}"


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


@contextmanager
def stack(script: Path, environment: dict[str, str], *arguments: str) -> Iterator[Path]:
    """The file with the output of a sample that runs in a process of its own, and is ended as by Ctrl-C.

    rclpy may miss a signal that arrives just before it waits, so the signal is repeated, as people do.
    """
    log = script.with_suffix(".log")
    with (
        log.open("w") as file,
        subprocess.Popen([sys.executable, script, *arguments], stdout=file, stderr=file, env=environment) as process,
    ):
        try:
            yield log
        finally:
            while process.poll() is None:
                process.send_signal(signal.SIGINT)
                with suppress(subprocess.TimeoutExpired):
                    process.wait(2)


@pytest.mark.slow
def test_the_samples_of_the_page_see_every_cloud(simbev: Simbev, tmp_path: Path) -> None:
    config, evaluation = blocks("yaml")
    assert config.count(PARTICIPANTS) == 1
    config = config.replace(PARTICIPANTS, PARTICIPANTS.replace("my_stack", "my_stack, by_hand"))
    (tmp_path / "lockstep.yaml").write_text(config + evaluation)
    files = dict(zip(("stack", "answering", "by_hand"), blocks("python"), strict=True))
    scripts = {name: tmp_path / f"{name}.py" for name in files}
    for name, text in files.items():
        scripts[name].write_text(text)
    answering = f"{sys.executable} {scripts['answering']}"
    figures = tmp_path / "figures.json"
    command = simbev("run", tmp_path / "lockstep.yaml", "--stack", answering, "--evaluate", figures)
    renamed = ("--ros-args", "-r", "__node:=by_hand")
    with (
        stack(scripts["stack"], command.environment) as log,
        stack(scripts["by_hand"], command.environment, *renamed) as log_by_hand,
    ):
        code, output = command.finish()
    assert code == 0, output
    assert "40 frames of 1 scene; answered: 40 with boxes" in output
    for each in (log, log_by_hand):
        assert len(re.findall(r"^\d+\.\d\d s: \d+ points$", each.read_text(), re.MULTILINE)) == CLOUDS, each.read_text()
