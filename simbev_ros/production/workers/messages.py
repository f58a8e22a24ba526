"""Messages between a worker's process and the pool that it belongs to, and the observer at the worker's end."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from simbev_ros.config.rendering import Rendering
from simbev_ros.config.scenario import Scenario
from simbev_ros.production.events import ProductionEvent, SceneProgressed
from simbev_ros.production.observer import ProductionObserver
from simbev_ros.production.upload import Uploader
from simbev_ros.schema.scene.map_spec import MapSpec

_PROGRESS_INTERVAL_S = 0.25
"""Minimum time between two reports of the progress of a scene."""


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of a worker; the first message to it.

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


class Signal(Enum):
    """Messages without content."""

    READY = "the worker waits for a scene"
    HEARTBEAT = "the worker lives; sent every second"


@dataclass(frozen=True, slots=True)
class Report:
    """An event of a worker."""

    event: ProductionEvent


class ReportingObserver(ProductionObserver):
    """Sends every event as a ``Report``; progress is thinned out.

    Args:
        send: Called with each report.
    """

    def __init__(self, send: Callable[[Report], None]) -> None:
        self._send = send
        self._next_progress_s = 0.0

    def notify(self, event: ProductionEvent) -> None:
        """Send the event, unless it is progress and some was sent a moment ago."""
        if isinstance(event, SceneProgressed):
            now_s = time.monotonic()
            if now_s < self._next_progress_s:
                return
            self._next_progress_s = now_s + _PROGRESS_INTERVAL_S
        self._send(Report(event))
