"""``simbev run`` refuses options that do not go together, before anything starts."""

from collections.abc import Callable

import pytest


@pytest.mark.usefixtures("no_graph")
def test_reliable_topics_are_asked_for_in_real_time_only(refused: Callable[..., str]) -> None:
    message = refused("run", "demo", "--reliable")
    assert message == "error: --reliable: is for --live; in lockstep, all topics are reliable\n"
