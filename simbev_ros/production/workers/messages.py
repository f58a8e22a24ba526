"""Messages between a worker's process and the pool that it belongs to, and the observer at the worker's end."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from simbev_ros.config.rendering import Rendering
from simbev_ros.config.scenario import Scenario
from simbev_ros.production.observer import ProductionObserver
from simbev_ros.production.upload import Uploader
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec

_PROGRESS_INTERVAL_S = 0.25
"""Minimum time between two reports of the progress of a scene."""


@dataclass(frozen=True, slots=True)
class Settings:
    """What a worker needs to begin; the first message to it.

    Attributes:
        scenario: The configuration.
        staging: Its folder for unfinished scenes; None: a temporary one.
        maps: The configuration's maps; None: the worker resolves them.
        rendering: Devices that render, in place of the configuration's.
        uploader: Uploads finished bags; None: they stay in ``staging``.
    """

    scenario: Scenario
    staging: Path | None
    maps: tuple[MapSpec, ...] | None = None
    rendering: Rendering | None = None
    uploader: Uploader | None = None


class Sign(Enum):
    """Messages without content."""

    READY = "the worker can be given a scene"
    ALIVE = "the worker lives; sent every second"


class _Substitute(Enum):
    """Stands for something that the receiver knows."""

    SCENE = "the scene that was started last"


@dataclass(frozen=True, slots=True)
class Report:
    """A call of a worker's observer: the method's name and arguments."""

    event: str
    arguments: tuple[Any, ...]

    def repeat(self, observer: ProductionObserver, scene: SceneSpec | None) -> None:
        """Call another observer's method.

        Args:
            observer: Receives the call.
            scene: The scene that the worker plays, which is sent only when it starts.
        """
        given = [scene if argument is _Substitute.SCENE else argument for argument in self.arguments]
        getattr(observer, self.event)(*given)


class ReportingObserver(ProductionObserver):
    """Sends every call as a ``Report``; progress is thinned out.

    Args:
        send: Called with each report.
    """

    def __init__(self, send: Callable[[Report], None]) -> None:
        self.send = send
        self._next_progress_s = 0.0

    def scene_started(self, spec: SceneSpec) -> None:
        """Send the whole scene, once."""
        self.send(Report("scene_started", (spec,)))

    def scene_progressed(self, spec: SceneSpec, tick: int | None) -> None:
        """Send the progress unless some was sent a moment ago."""
        if time.monotonic() >= self._next_progress_s:
            self._next_progress_s = time.monotonic() + _PROGRESS_INTERVAL_S
            self.send(Report("scene_progressed", (_Substitute.SCENE, tick)))


def _forward(event: str) -> Callable[..., None]:
    def send(self: ReportingObserver, *arguments: Any) -> None:
        short = (_Substitute.SCENE if isinstance(argument, SceneSpec) else argument for argument in arguments)
        self.send(Report(event, tuple(short)))

    return send


for _event in vars(ProductionObserver).keys() - vars(ReportingObserver).keys():
    if not _event.startswith("_"):
        setattr(ReportingObserver, _event, _forward(_event))
