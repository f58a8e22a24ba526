"""Progress bars and messages of commands that play scenes or make datasets."""

import time
from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn
from rich.status import Status

from simbev_ros.cli.console import DESCRIPTION, TickRate, counting_progress, format_size, plural
from simbev_ros.cli.evaluate.live import print_live_tables
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.production.observer import ProductionObserver
from simbev_ros.production.scene_cost import SceneCost
from simbev_ros.scene.ending import DURATION, SceneEnd
from simbev_ros.schema.scene.spec import SceneSpec


class MapDisplay(ProductionObserver):
    """Shows what is prepared before scenes are played: maps, their surroundings, and leftovers that are removed.

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

    def leftover_removed(self, spec: SceneSpec) -> None:
        """Print which scene is recorded again."""
        self.console.print(f"{spec.name}: a run that was ended has left a part of it; it is made anew", soft_wrap=True)

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
    """Shows a bar for each scene in the making, and one for the dataset with speed, size, failures and time left."""

    def __init__(self, console: Console) -> None:
        super().__init__(console)
        self._bars = Progress(disable=True)
        self._total: TaskID = self._bars.add_task("")
        self._tasks: dict[str, TaskID] = {}
        self._ticks: dict[str, int] = {}
        self._began_s, self._frames, self._done, self._failed = time.monotonic(), 0, 0, 0

    def dataset_started(self, scenes: int, dataset_bytes: int) -> None:
        """Show the bar of the dataset, if there is something to make."""
        columns = (
            DESCRIPTION,
            BarColumn(bar_width=None),
            TextColumn("{task.fields[count]}"),
            TextColumn("{task.fields[speed]}", style="progress.data.speed"),
            TextColumn("{task.fields[size]}", style="progress.filesize"),
            TimeRemainingColumn(),
        )
        self._bars = Progress(*columns, console=self.console, expand=True, disable=not scenes)
        self._began_s = time.monotonic()
        used = format_size(dataset_bytes)
        self._total = self._bars.add_task("dataset", total=scenes, count=f"0/{scenes} scenes", speed="", size=used)
        self._bars.start()

    def workers_chosen(self, workers: int, cost: SceneCost) -> None:
        """Print the number of workers and why."""
        self.console.print(
            f"{plural(workers, 'worker')}: the first scene used {cost.cores:.1f} cores and "
            f"{format_size(cost.memory_mib * 2**20)}",
            style="dim",
            highlight=False,
            soft_wrap=True,
        )

    def worker_prepares(self, worker: str, step: str | None) -> None:
        """Show what the worker does, until it has done it."""
        if step is not None:
            self._show(worker, f"{worker}: {step}")
        else:
            self._hide(worker)

    def scene_started(self, spec: SceneSpec) -> None:
        """Show a bar for the scene."""
        self._ticks[spec.name] = -1
        self._show(spec.name, f"{spec.name}: loading")

    def scene_progressed(self, spec: SceneSpec, tick: int | None) -> None:
        """Advance the bars of scene and dataset."""
        if tick is None or spec.name not in self._tasks:
            return
        self._frames += max(tick - self._ticks[spec.name], 0)
        self._ticks[spec.name] = max(tick, self._ticks[spec.name])
        done = self._ticks[spec.name] + 1
        task = self._tasks[spec.name]
        self._bars.update(task, description=spec.name, total=spec.ticks, completed=done)
        own = next(each for each in self._bars.tasks if each.id == task)
        speed = "" if own.speed is None else f"{own.speed:.2f} frames/s"
        self._bars.update(task, count=f"{done}/{spec.ticks} frames", speed=speed)
        self._update_total()

    def scene_ended(self, spec: SceneSpec, end: SceneEnd | None) -> None:
        """Remove the scene's bar."""
        self._hide(spec.name)

    def scene_retried(self, entry: PlannedEntry, reason: str) -> None:
        """Print why the scene is tried again."""
        self._hide(entry.name)
        self.console.print(f"{entry.name}: {reason}; once more", soft_wrap=True)

    def scene_made(self, entry: PlannedEntry, dataset_bytes: int) -> None:
        """Count the scene, and show the disk space."""
        self._bars.update(self._total, size=format_size(dataset_bytes))
        self._finish_scene(entry)

    def scene_failed(self, entry: PlannedEntry, reason: str) -> None:
        """Print the reason, and count the scene."""
        self.console.print(f"{entry.name} failed: {reason}", soft_wrap=True)
        self._failed += 1
        self._finish_scene(entry)

    def dataset_ended(self) -> None:
        """Leave the bar of the dataset as it is."""
        for name in list(self._tasks):
            self._hide(name)
        self._bars.stop()

    def _finish_scene(self, entry: PlannedEntry) -> None:
        self._hide(entry.name)
        self._done += 1
        self._update_total()

    def _update_total(self) -> None:
        """Show the scenes that are done, with the finished fractions of those in the making."""
        by_id = {task.id: task for task in self._bars.tasks}
        running = [by_id[task] for task in self._tasks.values()]
        done = self._done + sum(task.percentage / 100.0 for task in running if task.total)
        scenes = int(by_id[self._total].total or 0)
        failed = f", {self._failed} failed" if self._failed else ""
        speed = self._frames / (time.monotonic() - self._began_s)
        count = f"{done:.1f}/{scenes} scenes{failed}"
        self._bars.update(self._total, completed=done, count=count, speed=f"{speed:.2f} frames/s")

    def _show(self, name: str, what: str) -> None:
        self._hide(name)
        self._tasks[name] = self._bars.add_task(what, total=None, count="", speed="", size="")

    def _hide(self, name: str) -> None:
        task = self._tasks.pop(name, None)
        if task is not None:
            self._bars.remove_task(task)
