"""Progress bars and messages of commands that play scenes or make datasets."""

import time
from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn
from rich.status import Status

from simbev_ros.cli.console import TickRate, counting_progress, format_size
from simbev_ros.cli.evaluate.live import print_live_tables
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.production.observer import ProductionObserver
from simbev_ros.scene.ending import DURATION, SceneEnd
from simbev_ros.scene.spec import SceneSpec


class MapDisplay(ProductionObserver):
    """Shows how maps are loaded and their surroundings are built, and prints the notes of maps.

    Args:
        console: Where to show it.
    """

    def __init__(self, console: Console) -> None:
        self.console = console
        self._status: Status | None = None
        self._regions: Progress | None = None

    def step_started(self, step: str) -> None:
        """Show a spinner."""
        self._status = self.console.status(escape(step))
        self._status.start()

    def step_ended(self) -> None:
        """Remove the spinner."""
        if self._status is not None:
            self._status.stop()
            self._status = None

    def graph_warned(self, node: str, message: str) -> None:
        """Print the warning."""
        self.console.print(f"warning: {node}: {message}", markup=False, soft_wrap=True)

    def map_noted(self, map_name: str, note: str) -> None:
        """Print the note."""
        self.console.print(f"map {map_name}: {note}", style="dim", highlight=False, soft_wrap=True)

    def surroundings_started(self, map_name: str, regions: int) -> None:
        """Show a bar of regions."""
        self._regions = counting_progress(self.console, TextColumn("regions"))
        self._regions.add_task(f"surroundings of {map_name}", total=regions)
        self._regions.start()

    def region_built(self) -> None:
        """Advance the bar of regions."""
        if self._regions is not None:
            self._regions.advance(self._regions.task_ids[0])

    def surroundings_ended(self) -> None:
        """Remove the bar of regions."""
        if self._regions is not None:
            self._regions.stop()
            self._regions = None


class SceneDisplay(MapDisplay):
    """Shows a bar for each scene that is played, and prints how it ended if that was early."""

    def __init__(self, console: Console) -> None:
        super().__init__(console)
        self._ticks: Progress | None = None

    def graph_started(self, domain_id: int, security_variables: Mapping[str, str]) -> None:
        """Print the ROS domain, and what others need to take part in a secure graph."""
        for name, value in {"ROS_DOMAIN_ID": str(domain_id), **security_variables}.items():
            self.console.print(f"{name}={value}", style="dim", markup=False, highlight=False, soft_wrap=True)

    def stack_evaluated(self, figures: Mapping[str, Any]) -> None:
        """Print the figures as tables."""
        print_live_tables(figures, self.console)

    def leftover_removed(self, spec: SceneSpec) -> None:
        """Print which scene is recorded again."""
        self.console.print(f"{spec.name}: a run that was ended has left a part of it; it is made anew", soft_wrap=True)

    def scene_started(self, spec: SceneSpec) -> None:
        """Show a bar of ticks."""
        self._ticks = counting_progress(
            self.console, TextColumn("ticks"), TickRate(), TimeRemainingColumn(), transient=False
        )
        self._ticks.add_task(f"{spec.name}: loading", total=None)
        self._ticks.start()

    def scene_progressed(self, spec: SceneSpec, tick: int | None) -> None:
        """Advance the bar of ticks."""
        if self._ticks is not None and tick is not None:
            task = self._ticks.task_ids[0]
            self._ticks.update(task, description=spec.name, total=spec.ticks, completed=max(tick + 1, 0))

    def scene_ended(self, spec: SceneSpec, end: SceneEnd | None) -> None:
        """Leave the bar as it is, and print why the scene ended if it ended early."""
        if self._ticks is not None:
            self._ticks.stop()
            self._ticks = None
        if end is not None and end.reason != DURATION:
            self.console.print(f"{spec.name} ended early: {end.reason}", highlight=False, soft_wrap=True)


class DatasetDisplay(MapDisplay):
    """Shows one bar for all scenes of a dataset: the current scene, frames per second, disk space, time left."""

    def __init__(self, console: Console) -> None:
        super().__init__(console)
        self._bars = Progress(disable=True)
        self._task: TaskID = self._bars.add_task("")
        self._began_s, self._frames, self._last_tick = time.monotonic(), 0, -1
        self._done = 0

    def dataset_started(self, scenes: int, dataset_bytes: int) -> None:
        """Show the bar, if there is something to make."""
        columns = (
            TextColumn("{task.fields[what]}", markup=False),
            BarColumn(bar_width=None),
            TextColumn("{task.completed:.1f}/{task.fields[scenes]} scenes"),
            TextColumn("{task.fields[speed]}", style="progress.data.speed"),
            TextColumn("{task.fields[used]}", style="progress.filesize"),
            TimeRemainingColumn(),
        )
        self._bars = Progress(*columns, console=self.console, expand=True, disable=not scenes)
        self._began_s = time.monotonic()
        used = format_size(dataset_bytes)
        self._task = self._bars.add_task("", total=scenes, what="", speed="", used=used, scenes=scenes)
        self._bars.start()

    def scene_progressed(self, spec: SceneSpec, tick: int | None) -> None:
        """Show the last finished tick of the current scene."""
        done = -1 if tick is None else max(tick, -1)
        self._frames += max(done - self._last_tick, 0)
        self._last_tick = done
        speed = self._frames / (time.monotonic() - self._began_s)
        what = f"{spec.name} {done + 1}/{spec.ticks}"
        share = self._done + min((done + 1) / spec.ticks, 1.0)
        self._bars.update(self._task, completed=share, what=what, speed=f"{speed:.2f} frames/s")

    def scene_retried(self, spec: SceneSpec, reason: str) -> None:
        """Print why the scene is tried again."""
        self.console.print(f"{spec.name}: {reason}; once more", soft_wrap=True)

    def scene_made(self, entry: PlannedEntry, dataset_bytes: int) -> None:
        """Count the scene, and show the disk space."""
        self._bars.update(self._task, used=format_size(dataset_bytes))
        self._finish_scene()

    def scene_failed(self, entry: PlannedEntry, reason: str) -> None:
        """Count the scene."""
        self._finish_scene()

    def dataset_ended(self) -> None:
        """Leave the bar as it is."""
        self._bars.stop()

    def _finish_scene(self) -> None:
        self._done, self._last_tick = self._done + 1, -1
        self._bars.update(self._task, completed=self._done)
