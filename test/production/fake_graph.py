"""A graph that is not there: sessions that write made-up bags, or fail as a test asks."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from made_up_scene import made_up_scene

from simbev_ros.config.rendering import Rendering
from simbev_ros.config.scenario import Scenario
from simbev_ros.recording.layout import partial_of, scene_folder
from simbev_ros.ros.graph.session import Progress
from simbev_ros.scene.ending import DURATION, SceneEnd
from simbev_ros.schema.scene.spec import SceneSpec

Scenarios = Callable[[int], Scenario]
"""Makes a configuration of some scenes."""


class FakeGraph:
    """Stands for all sessions of a test.

    Attributes:
        problems: By number of scene the errors of its first attempts.
        log: What happened to sessions: ``start``, ``close`` and names of scenes.
        replays: For each scene that was played the bag with its motion; None: it was simulated.
    """

    def __init__(self) -> None:
        self.problems: dict[int, list[BaseException]] = {}
        self.log: list[str] = []
        self.replays: list[Path | None] = []

    def session(self, scenario: Scenario, *, dataset: Path, rendering: Rendering | None) -> Any:
        """Called instead of ``GraphSession``."""
        assert scenario.evaluation is None
        return FakeSession(self, dataset)


class FakeSession:
    """One session: a scene has two ticks."""

    has_lost_driver = False

    def __init__(self, graph: FakeGraph, dataset: Path) -> None:
        self._graph, self._dataset = graph, dataset

    def start(self) -> None:
        self._graph.log.append("start")

    def close(self) -> None:
        self._graph.log.append("close")

    def pids(self) -> dict[str, int]:
        return {"supervisor": os.getpid()}

    def new_output(self) -> dict[str, str]:
        return {"world": "a line of the world node\n"}

    def new_warnings(self) -> list[tuple[str, str]]:
        return []

    def new_losses(self) -> list[str]:
        return []

    def new_advice(self) -> list[str]:
        return []

    def play(
        self,
        spec: SceneSpec,
        progress: Progress,
        replay: Path | None = None,
        config: Scenario | None = None,
        *,
        paused: bool = False,
    ) -> SceneEnd:
        self._graph.log.append(spec.name)
        self._graph.replays.append(replay)
        bag = scene_folder(self._dataset, spec.split, spec.name)
        progress(None)
        if problems := self._graph.problems.get(spec.number):
            partial_of(bag).mkdir(parents=True)
            raise problems.pop(0)
        made_up_scene(bag, number=spec.number, split=spec.split, ticks=2)
        progress(1)
        return SceneEnd(scene=spec.name, tick=1, reason=DURATION)
