"""``simbev run`` refuses options that do not go together, before anything starts, and says how to subscribe."""

from collections.abc import Callable
from typing import Any

import pytest

from simbev_ros.production import play


@pytest.mark.usefixtures("no_graph")
def test_reliable_topics_are_asked_for_in_real_time_only(refused: Callable[..., str]) -> None:
    message = refused("run", "demo", "--reliable")
    assert message == "error: --reliable: is for --live; in lockstep, all topics are reliable\n"


@pytest.mark.parametrize(
    ("options", "command"),
    [
        ((), "simbev env"),
        (("--domain", "3"), "simbev env --domain 3"),
        (("--domain", "0", "--network"), "simbev env --network"),
    ],
)
def test_one_line_says_what_shells_with_subscribers_call(
    simbev: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], command: str
) -> None:
    monkeypatch.delenv("SIMBEV_COMMAND", raising=False)
    monkeypatch.setattr(play, "play_scenes", lambda *_, **__: iter(()))
    answer = simbev("run", "demo", *options)
    printed = [line for line in (answer.out + answer.err).splitlines() if "env" in line or "export" in line]
    assert printed == [f"subscribers: source <({command})"]
