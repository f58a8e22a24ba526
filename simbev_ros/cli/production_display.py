"""Progress bars and messages of commands that play scenes or make datasets."""

import time
from typing import assert_never

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn
from rich.status import Status

from simbev_ros.cli.console import DESCRIPTION, ReportingProgress, TickRate, counting_progress, format_size
from simbev_ros.cli.evaluate.live import print_live_tables
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.foundation.counts import plural
from simbev_ros.production.events import (
    DatasetEnded,
    DatasetStarted,
    GraphStarted,
    GraphWarned,
    LeftoverRemoved,
    MapNoted,
    ProductionEvent,
    RegionBuilt,
    SceneEnded,
    SceneFailed,
    SceneMade,
    SceneProgressed,
    SceneRefused,
    SceneRetried,
    SceneStarted,
    StackEvaluated,
    StepEnded,
    StepStarted,
    SurroundingsEnded,
    SurroundingsStarted,
    WorkerPrepares,
    WorkersChosen,
)
from simbev_ros.production.observer import ProductionObserver
from simbev_ros.production.scene_cost import SceneCost
from simbev_ros.scene.ending import DURATION
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

    def notify(self, event: ProductionEvent) -> None:
        """Show a spinner for a step, a bar for surroundings, and print notes and warnings."""
        match event:
            case StepStarted(step):
                self._status = self.console.status(escape(step))
                self._status.start()
            case StepEnded():
                self._stop_spinner()
            case GraphWarned(node, message):
                self.console.print(f"warning: {node}: {message}", markup=False, soft_wrap=True)
            case MapNoted(map_name, note):
                self.console.print(f"map {map_name}: {note}", style="dim", highlight=False, soft_wrap=True)
            case LeftoverRemoved(scene):
                self.console.print(
                    f"{scene}: an interrupted run left a part of it; it is recorded again", soft_wrap=True
                )
            case SceneRefused(scene, problems):
                self.console.print(f"{scene}: {'; '.join(problems)}: drawn again", highlight=False, soft_wrap=True)
            case SurroundingsStarted() | RegionBuilt() | SurroundingsEnded():
                self._show_regions(event)
            case GraphStarted() | StackEvaluated() | SceneStarted() | SceneProgressed() | SceneEnded():
                pass
            case DatasetStarted() | WorkersChosen() | WorkerPrepares() | DatasetEnded():
                pass
            case SceneRetried() | SceneMade() | SceneFailed():
                pass
            case _:
                assert_never(event)

    def _stop_spinner(self) -> None:
        if self._status is not None:
            self._status.stop()
            self._status = None

    def _show_regions(self, event: SurroundingsStarted | RegionBuilt | SurroundingsEnded) -> None:
        if isinstance(event, SurroundingsStarted):
            self._regions = counting_progress(self.console, TextColumn("regions"))
            self._regions.add_task(f"surroundings of {event.map_name}", total=event.regions)
            self._regions.start()
        elif self._regions is not None and isinstance(event, RegionBuilt):
            self._regions.advance(self._regions.task_ids[0])
        elif self._regions is not None:
            self._regions.stop()
            self._regions = None


class SceneDisplay(MapDisplay):
    """Shows a bar for each scene that is played, and prints how it ended if that was early."""

    def __init__(self, console: Console) -> None:
        super().__init__(console)
        self._ticks: Progress | None = None
        self._total = 0

    def notify(self, event: ProductionEvent) -> None:
        """Show a bar of ticks; print the ROS domain, figures of stacks, and why a scene ended early."""
        match event:
            case GraphStarted(domain_id, variables):
                for name, value in {"ROS_DOMAIN_ID": str(domain_id), **variables}.items():
                    self.console.print(f"{name}={value}", style="dim", markup=False, highlight=False, soft_wrap=True)
            case StackEvaluated(figures):
                print_live_tables(figures, self.console)
            case SceneStarted(spec):
                self._start_bar(spec)
            case SceneProgressed(scene, tick) if self._ticks is not None and tick is not None:
                task = self._ticks.task_ids[0]
                self._ticks.update(task, description=scene, total=self._total, completed=max(tick + 1, 0))
            case SceneEnded(scene, end):
                self._leave_bar()
                if end is not None and end.reason != DURATION:
                    self.console.print(f"{scene} ended early: {end.reason}", highlight=False, soft_wrap=True)
            case _:
                super().notify(event)

    def _start_bar(self, spec: SceneSpec) -> None:
        columns = TextColumn("ticks"), TickRate(), TimeRemainingColumn()
        self._ticks, self._total = counting_progress(self.console, *columns, transient=False), spec.ticks
        self._ticks.add_task(f"{spec.name}: loading", total=None)
        self._ticks.start()

    def _leave_bar(self) -> None:
        if self._ticks is not None:
            self._ticks.stop()
            self._ticks = None


class DatasetDisplay(MapDisplay):
    """Shows a bar for each scene in the making, and one for the dataset with speed, size, failures and time left.

    Args:
        console: Where to show it.
        name: What the dataset's bar is called.
    """

    def __init__(self, console: Console, name: str = "dataset") -> None:
        super().__init__(console)
        self._name = name
        self._bars = Progress(disable=True)
        self._total: TaskID = self._bars.add_task("")
        self._tasks: dict[str, TaskID] = {}
        self._scene_ticks: dict[str, int] = {}
        self._ticks: dict[str, int] = {}
        self._began_s, self._frames, self._done, self._failed = time.monotonic(), 0, 0, 0

    def notify(self, event: ProductionEvent) -> None:
        """Show and advance bars; print the number of workers, and why scenes are made again or failed."""
        match event:
            case DatasetStarted(scenes, dataset_bytes):
                self._start_bars(scenes, dataset_bytes)
            case WorkersChosen(workers, cost):
                self._print_workers(workers, cost)
            case WorkerPrepares(worker, None):
                self._hide(worker)
            case WorkerPrepares(worker, step):
                self._show(worker, f"{worker}: {step}")
            case SceneStarted(spec):
                self._ticks[spec.name], self._scene_ticks[spec.name] = -1, spec.ticks
                self._show(spec.name, f"{spec.name}: loading")
            case SceneProgressed(scene, tick) if tick is not None and scene in self._tasks:
                self._advance(scene, tick)
            case SceneEnded(scene):
                self._hide(scene)
            case SceneRetried(entry, reason):
                self._hide(entry.name)
                self.console.print(f"{entry.name}: {reason}; once more", soft_wrap=True)
            case SceneMade(entry, dataset_bytes):
                self._bars.update(self._total, size=format_size(dataset_bytes))
                self._finish_scene(entry)
            case SceneFailed(entry, reason):
                self.console.print(f"{entry.name} failed: {reason}", soft_wrap=True)
                self._failed += 1
                self._finish_scene(entry)
            case DatasetEnded():
                self._leave_bars()
            case _:
                super().notify(event)

    def _start_bars(self, scenes: int, dataset_bytes: int) -> None:
        """Show the bar of the dataset, if there is something to make."""
        columns = (
            DESCRIPTION,
            BarColumn(bar_width=None),
            TextColumn("{task.fields[count]}"),
            TextColumn("{task.fields[speed]}", style="progress.data.speed"),
            TextColumn("{task.fields[size]}", style="progress.filesize"),
            TimeRemainingColumn(),
        )
        self._bars = ReportingProgress(*columns, console=self.console, expand=True, disable=not scenes)
        self._began_s = time.monotonic()
        used = format_size(dataset_bytes)
        self._total = self._bars.add_task(self._name, total=scenes, count=f"0/{scenes} scenes", speed="", size=used)
        self._bars.start()

    def _print_workers(self, workers: int, cost: SceneCost) -> None:
        """Print the number of workers and why."""
        self.console.print(
            f"{plural(workers, 'worker')}: the first scene used {cost.cores:.1f} cores and "
            f"{format_size(cost.memory_mib * 2**20)}",
            style="dim",
            highlight=False,
            soft_wrap=True,
        )

    def _advance(self, scene: str, tick: int) -> None:
        """Advance the bars of scene and dataset."""
        self._frames += max(tick - self._ticks[scene], 0)
        self._ticks[scene] = max(tick, self._ticks[scene])
        done, ticks = self._ticks[scene] + 1, self._scene_ticks[scene]
        task = self._tasks[scene]
        self._bars.update(task, description=scene, total=ticks, completed=done)
        own = next(each for each in self._bars.tasks if each.id == task)
        speed = "" if own.speed is None else f"{own.speed:.2f} frames/s"
        self._bars.update(task, count=f"{done}/{ticks} frames", speed=speed)
        self._update_total()

    def _leave_bars(self) -> None:
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
