"""Scenes that others ask a running graph to play: the queue between their services and the loop that plays scenes.

Orders enter from the threads of services; the loop takes drawn scenes out and notes their progress. Pure.
"""

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from enum import IntEnum
from typing import NamedTuple

from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import SimbevError
from simbev_ros.schema.scene.spec import SceneSpec

_MAX_WAITING = 1000


class SceneOrder(NamedTuple):
    """A request for a scene.

    Attributes:
        configuration: A file, the name of a shipped one, or YAML text; empty: the configuration of the graph.
        seed: Base seed; None: the configured one.
        number: Number of the scene in the configuration; None: the one after the scene that was ordered before.
    """

    configuration: str = ""
    seed: int | None = None
    number: int | None = None


class Phase(IntEnum):
    """Phase of a scene; the numbers are those of simbev_interfaces/action/RunScene."""

    LOADING = 0
    WARM_UP = 1
    PLAYING = 2
    FINISHING = 3
    WAITING = 4


class Outcome(NamedTuple):
    """How a scene ended.

    Attributes:
        success: Whether it was played to its end, and its bag, if it is recorded, is complete.
        message: Why not.
        last_tick: Number of its last tick; -1: none was played.
        reason: Why it ended; empty if it was not played.
        bag: Absolute path of the bag; empty: not recorded.
    """

    success: bool
    message: str = ""
    last_tick: int = -1
    reason: str = ""
    bag: str = ""


class OrderedScene:
    """A scene of the queue.

    Attributes:
        scenario: Its configuration.
        spec: What was drawn.
        phase: What happens to it.
        tick: The last tick that all nodes have finished; negative before the first one.
        outcome: How it ended.
        paused: Whether the world waits before its first tick.
        stop_reason: Reason to end it early; None: play it to its end.
    """

    def __init__(self, scenario: Scenario, spec: SceneSpec, *, paused: bool = False) -> None:
        self.scenario, self.spec, self.paused = scenario, spec, paused
        self.phase, self.tick = Phase.WAITING, -1
        self.outcome: Future[Outcome] = Future()
        self.stop_reason: str | None = None

    def stop(self, reason: str) -> None:
        """Let the scene end early; one that is still waiting is not played."""
        self.stop_reason = self.stop_reason or reason

    def finish(self, outcome: Outcome) -> None:
        """Note how the scene ended, once."""
        with suppress(InvalidStateError):
            self.outcome.set_result(outcome)

    def note_progress(self, tick: int | None) -> None:
        """Note the last finished tick; None while the nodes load the scene."""
        if tick is None:
            self.phase = Phase.LOADING
            return
        self.tick = tick
        self.phase = Phase.WARM_UP if tick < 0 else Phase.PLAYING if tick + 1 < self.spec.ticks else Phase.FINISHING


class SceneQueue:
    """Scenes that are to be played, in the order in which they were asked for.

    Args:
        draw: Draws the scene of an order, or raises SimbevError. It is called in the thread that orders, for one order
            at a time.

    Attributes:
        latest: The scene that was taken last; None: none was, or its world was unloaded.
        is_quitting: Whether the graph shall end.
    """

    def __init__(self, draw: Callable[[SceneOrder], tuple[Scenario, SceneSpec]]) -> None:
        self._draw = draw
        self._waiting: deque[OrderedScene] = deque()
        self._current: OrderedScene | None = None
        self._drawing, self._changed = threading.Lock(), threading.Condition()
        self._closed = self.is_quitting = False
        self.latest: OrderedScene | None = None

    @property
    def active(self) -> OrderedScene | None:
        """The scene that is being played, or else the next one."""
        with self._changed:
            scenes = [each for each in (self._current, *self._waiting) if each is not None]
        return next((each for each in scenes if not each.outcome.done()), None)

    def order(self, order: SceneOrder, *, interrupt: bool, paused: bool = False) -> OrderedScene:
        """Draw a scene and add it to the queue.

        Args:
            order: What is asked for.
            interrupt: Whether the scene that is being played ends, and waiting ones are dropped.
            paused: Whether the world waits before the first tick.

        Raises:
            SimbevError: It cannot be drawn, or the queue is full or closed; the message says why.
        """
        with self._drawing:
            scenario, spec = self._draw(order)
        return self._add(OrderedScene(scenario, spec, paused=paused), interrupt=interrupt)

    def repeat(self, scene: OrderedScene, *, paused: bool) -> OrderedScene:
        """Add a scene again in place of all others; arguments and errors as for ``order``."""
        return self._add(OrderedScene(scene.scenario, scene.spec, paused=paused), interrupt=True)

    def _add(self, scene: OrderedScene, *, interrupt: bool) -> OrderedScene:
        with self._changed:
            if self._closed:
                raise SimbevError("the graph is about to end")
            if interrupt:
                self._end_all(f"{scene.spec.name} was asked for instead")
            if len(self._waiting) >= _MAX_WAITING:
                raise SimbevError(f"{_MAX_WAITING} scenes are waiting already")
            self._waiting.append(scene)
            self._changed.notify()
        return scene

    def take(self, timeout_s: float) -> OrderedScene | None:
        """Take the next scene, which then counts as playing; None after the timeout."""
        with self._changed:
            self._current = None
            while True:
                while self._waiting:
                    scene = self._waiting.popleft()
                    if scene.stop_reason is None:
                        self._current = self.latest = scene
                        return scene
                    scene.finish(Outcome(success=False, message=scene.stop_reason))
                if not self._changed.wait(timeout_s):
                    return None

    def end_all(self, reason: str) -> None:
        """Drop the scenes that wait, and let the current one end."""
        with self._changed:
            self._end_all(reason)

    def quit(self) -> None:
        """Let the graph end, with the current scene."""
        with self._changed:
            self.is_quitting = self._closed = True
            self._end_all("the graph was told to quit")
            self._changed.notify()

    def close(self) -> None:
        """Refuse further orders, and end those that wait."""
        with self._changed:
            self._closed = True
            self._end_all("the graph has ended")
            current = self._current
        if current is not None:
            current.finish(Outcome(success=False, message="the graph has ended", last_tick=current.tick))

    def _end_all(self, reason: str) -> None:
        """Drop the scenes that wait, and let the current one end."""
        for scene in self._waiting:
            scene.finish(Outcome(success=False, message=reason))
        self._waiting.clear()
        if self._current is not None:
            self._current.stop(reason)
