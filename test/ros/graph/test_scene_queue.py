"""Scenes that are asked for: played in order, ended for others, and refused when it is too late."""

from collections.abc import Callable
from typing import Any

import pytest

from simbev_ros.foundation.errors import InputError, SimbevError
from simbev_ros.ros.graph import scene_queue
from simbev_ros.ros.graph.scene_queue import Outcome, Phase, SceneOrder, SceneQueue


class Spec:
    """A drawn scene, as far as the queue looks at it."""

    def __init__(self, name: str) -> None:
        self.name, self.ticks = name, 10


def draw(order: SceneOrder) -> Any:
    if order.number == 13:
        raise InputError("number 13: no such scene")
    return None, Spec(f"Blocks-{order.number:04d}")


def order(queue: SceneQueue, number: int, *, interrupt: bool = False) -> Any:
    return queue.order(SceneOrder(number=number), interrupt=interrupt)


@pytest.fixture
def queue() -> SceneQueue:
    return SceneQueue(draw)


def test_scenes_are_played_in_the_order_in_which_they_were_asked_for(queue: SceneQueue) -> None:
    scenes = [order(queue, number) for number in range(3)]
    assert [queue.take(0.0) for _ in range(4)] == [*scenes, None]


def test_an_interrupting_scene_ends_the_current_one_and_drops_those_that_wait(queue: SceneQueue) -> None:
    current = order(queue, 0)
    assert queue.take(0.0) is current
    waiting, urgent = order(queue, 1), order(queue, 2, interrupt=True)
    assert current.stop_reason == "Blocks-0002 was asked for instead"
    assert queue.take(0.0) is urgent
    assert waiting.outcome.result(0) == Outcome(success=False, message="Blocks-0002 was asked for instead")
    assert urgent.stop_reason is None


def test_a_scene_that_is_stopped_while_it_waits_is_not_played(queue: SceneQueue) -> None:
    scene = order(queue, 0)
    scene.stop("its goal was canceled")
    assert queue.take(0.0) is None
    assert scene.outcome.result(0).message == "its goal was canceled"


def test_a_scene_that_cannot_be_drawn_is_refused_and_leaves_the_queue_as_it_is(queue: SceneQueue) -> None:
    current = order(queue, 0)
    queue.take(0.0)
    with pytest.raises(InputError, match="no such scene"):
        order(queue, 13, interrupt=True)
    assert current.stop_reason is None


def test_a_closed_queue_ends_every_scene_and_takes_no_more(queue: SceneQueue) -> None:
    current, waiting = order(queue, 0), order(queue, 1)
    queue.take(0.0)
    current.note_progress(4)
    queue.close()
    assert current.outcome.result(0) == Outcome(success=False, message="the graph has ended", last_tick=4)
    assert waiting.outcome.result(0).message == "the graph has ended"
    with pytest.raises(SimbevError, match="about to end"):
        order(queue, 2)


def test_the_first_outcome_of_a_scene_counts(queue: SceneQueue) -> None:
    scene = order(queue, 0)
    scene.finish(Outcome(success=True, last_tick=9))
    scene.finish(Outcome(success=False, message="the graph has ended"))
    assert scene.outcome.result(0).success


@pytest.mark.parametrize(
    ("tick", "phase"),
    [(None, Phase.LOADING), (-3, Phase.WARM_UP), (0, Phase.PLAYING), (8, Phase.PLAYING), (9, Phase.FINISHING)],
)
def test_the_phase_follows_from_the_tick(queue: SceneQueue, tick: int | None, phase: Phase) -> None:
    scene = order(queue, 0)
    assert scene.phase is Phase.WAITING
    scene.note_progress(tick)
    assert scene.phase is phase


def test_phases_are_those_of_the_action(phases_of_action: Callable[[], dict[str, int]]) -> None:
    assert {phase.name: int(phase) for phase in Phase} == phases_of_action()


@pytest.fixture
def phases_of_action() -> Callable[[], dict[str, int]]:
    """Constants of the action's definition, as written in its file."""
    from simbev_ros.foundation.installation.interface_files import interface_files

    def read() -> dict[str, int]:
        lines = interface_files("simbev_interfaces")["simbev_interfaces/action/RunScene"].read_text().splitlines()
        words = [line.split("#")[0].split()[1] for line in lines if line.startswith("uint8 PHASE_")]
        return {name.removeprefix("PHASE_"): int(value) for name, _, value in (word.partition("=") for word in words)}

    return read


def test_a_full_queue_refuses_a_scene_unless_it_replaces_all_others(
    queue: SceneQueue, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scene_queue, "_MAX_WAITING", 2)
    waiting = [order(queue, number) for number in range(2)]
    with pytest.raises(SimbevError, match="2 scenes are waiting already"):
        order(queue, 2)
    urgent = order(queue, 3, interrupt=True)
    assert all(scene.outcome.done() for scene in waiting)
    assert queue.take(0.0) is urgent
