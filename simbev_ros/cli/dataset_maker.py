"""Making the scenes of a dataset, one after the other, whatever happens to some of them."""

import shutil
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.filesize import decimal
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from simbev_ros.cli.scenes import build_surroundings, map_roads
from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.index import Row, bring_up_to_date, row_of, write_index
from simbev_ros.dataset.plan import Plan, PlannedEntry, bag_of
from simbev_ros.dataset.staging import move_in, staging_of
from simbev_ros.errors import DiskError, GraphError, InputError, SimbevError
from simbev_ros.graph.session import GraphSession
from simbev_ros.graph.traces import sweep
from simbev_ros.maps.source import map_spec
from simbev_ros.maps.spec import MapSpec
from simbev_ros.recording.bag_files import check_space
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene, starts_of
from simbev_ros.scene.drawing.starts import Starts
from simbev_ros.scene.ending import SceneEnd
from simbev_ros.scene.spec import SceneSpec

LOG_FOLDER = "logs"


class Drawer:
    """Draws planned scenes; what the scenes of a map share is worked out once for those that follow each other."""

    def __init__(self, scenario: Scenario, console: Console) -> None:
        self._scenario, self._console = scenario, console
        specs = [map_spec(asked.map) for asked in scenario.scenes]
        self._maps: Mapping[str, MapSpec] = {spec.name: spec for spec in specs}
        self._latest: tuple[MapSpec, Starts] | None = None

    def draw(self, entry: PlannedEntry) -> SceneSpec:
        """A scene.

        Raises:
            InputError: It cannot be drawn, or its map is not one of the configuration's.
        """
        if entry.map not in self._maps:
            raise InputError(f"scene {entry.name}: the configuration has no map {entry.map}")
        spec = self._maps[entry.map]
        network = map_roads(spec, self._console)
        if self._latest is None or self._latest[0] != spec:
            self._latest = spec, starts_of(self._scenario, network)
        planned = PlannedScene(entry.number, spec, entry.split)
        return draw_scene(self._scenario, planned, network, self._latest[1])


@dataclass(slots=True)
class Outcome:
    """What has been made.

    Attributes:
        made: Scenes.
        failed: What is wrong, by the scene's name.
    """

    made: list[PlannedEntry] = field(default_factory=list)
    failed: dict[str, str] = field(default_factory=dict)


class DatasetMaker:
    """Makes scenes on a graph that is started when it is needed, and anew after it has failed.

    As a context manager it stops the graph.
    """

    def __init__(self, scenario: Scenario, dataset: Path, console: Console, *, retries: int) -> None:
        self._scenario, self._dataset, self._console, self._retries = scenario, dataset, console, retries
        self._drawer = Drawer(scenario, console)
        self._session: GraphSession | None = None
        sweep()  # also where nothing is left to make
        plan = Plan.of(dataset)
        there = [bag for bag in (bag_of(dataset, entry) for entry in plan.scenes) if bag.is_dir()]
        with console.status("reading the scenes that are there"):
            rows, self._damaged = bring_up_to_date(dataset, there)
        self._rows: dict[int, Row] = {row["number"]: row for row in rows}

    def make(self, entries: Sequence[PlannedEntry]) -> Outcome:
        """Make scenes; one that fails is tried again, then listed, and the others go on, as are damaged ones.

        Raises:
            InputError: The first scene cannot be made with this configuration.
            DiskError: The disk is full, or nearly; the scenes made before are whole.
        """
        outcome = Outcome()
        with _bars(self._console, hidden=not entries) as bars:
            board = _Board(bars, len(entries), self._used_bytes)
            for entry in entries:
                self._check_space()
                try:
                    row = self._made(entry, board)
                except InputError as error:
                    if not outcome.made and not outcome.failed:
                        raise
                    outcome.failed[entry.name] = str(error)
                except DiskError:
                    raise
                except SimbevError as error:
                    outcome.failed[entry.name] = str(error)
                else:
                    self._rows[entry.number] = row
                    write_index(self._dataset, self._rows.values())
                    outcome.made.append(entry)
                    self._damaged.pop(bag_of(self._dataset, entry), None)
                    board.show_used(self._used_bytes)
                board.finish_scene()
        for bag, problem in self._damaged.items():
            number = int(bag.name.rpartition("-")[2])
            outcome.failed[bag.name] = f"damaged: {problem}; --replace {number} makes it anew"
        return outcome

    @property
    def _used_bytes(self) -> int:
        return sum(row["bytes"] for row in self._rows.values())

    def _made(self, entry: PlannedEntry, board: "_Board") -> Row:
        """The index' row of a scene that has been made and moved to its place."""
        spec = self._drawer.draw(entry)
        build_surroundings([spec], self._console)
        for attempt in range(self._retries + 1):
            log = SceneLog(self._dataset, spec.name, attempt)
            shutil.rmtree(bag_of(staging_of(self._dataset), entry).parent, ignore_errors=True)
            try:
                end = self._played(spec, board)
            except GraphError as error:
                log.end(str(error), self._stop(), failed=True)
                if attempt == self._retries:
                    raise
                self._console.print(f"{spec.name}: {error}; once more", markup=False, soft_wrap=True)
                continue
            row = row_of(move_in(self._dataset, entry), self._dataset)
            log.end(f"{end.reason} after tick {end.tick}, {row['bytes']:,} bytes", self._logs())
            return row
        raise AssertionError("the last attempt returns or raises")

    def _played(self, spec: SceneSpec, board: "_Board") -> SceneEnd:
        if self._session is None:
            self._session = GraphSession(self._scenario, dataset=staging_of(self._dataset)).__enter__()
        return self._session.play(spec, lambda tick: board.show(spec, tick))

    def _logs(self) -> dict[str, str]:
        return {} if self._session is None else self._session.new_output()

    def _stop(self) -> dict[str, str]:
        """End the graph; give what its processes have written last."""
        output = self._logs()
        if self._session is not None:
            self._session.__exit__()
            self._session = None
        return output

    def _check_space(self) -> None:
        """Refuse to begin a scene that may not fit.

        Raises:
            DiskError: There is less free than the largest scene so far takes, and what must stay free.
        """
        largest = max((row["bytes"] for row in self._rows.values()), default=0)
        check_space(self._dataset, self._scenario.recording.least_free_mib << 20, largest)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop()
        shutil.rmtree(staging_of(self._dataset), ignore_errors=True)


class SceneLog:
    """What happened while a scene was made, as ``logs/<scene>.log``; of attempts that failed, as ``….failed-1.log``."""

    def __init__(self, dataset: Path, name: str, attempt: int) -> None:
        self._folder, self._name, self._attempt = dataset / LOG_FOLDER, name, attempt
        self._began = time.time()

    def end(self, words: str, output: Mapping[str, str], *, failed: bool = False) -> None:
        """Write it: how it ended, and what each process has written."""
        name = f"{self._name}.failed-{self._attempt + 1}" if failed else self._name
        self._folder.mkdir(exist_ok=True)
        lasted_s = time.time() - self._began
        began = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(self._began))
        lines = [f"{self._name}, attempt {self._attempt + 1}, began {began}, took {lasted_s:.1f} s", words]
        for process, text in output.items():
            lines += [f"--- {process}", text.rstrip()] if text.strip() else []
        (self._folder / f"{name}.log").write_text("\n".join(lines) + "\n", encoding="utf-8")


class _Board:
    """The progress bar: scenes, frames per second, disk used, time left."""

    def __init__(self, bars: Progress, scenes: int, used_bytes: int) -> None:
        self._bars = bars
        self._began_s, self._frames, self._last_tick = time.monotonic(), 0, -1
        self._done = 0
        self._task: TaskID = bars.add_task("", total=scenes, what="", speed="", used=decimal(used_bytes), scenes=scenes)

    def show(self, spec: SceneSpec, tick: int | None) -> None:
        """The last finished tick of the scene in the making; None while it is loaded."""
        done = -1 if tick is None else max(tick, -1)
        self._frames += max(done - self._last_tick, 0)
        self._last_tick = done
        speed = self._frames / (time.monotonic() - self._began_s)
        what = escape(f"{spec.name} {done + 1}/{spec.ticks}")
        share = self._done + min((done + 1) / spec.ticks, 1.0)
        self._bars.update(self._task, completed=share, what=what, speed=f"{speed:.2f} frames/s")

    def show_used(self, count: int) -> None:
        """Bytes of all scenes."""
        self._bars.update(self._task, used=decimal(count))

    def finish_scene(self) -> None:
        """The scene in the making is done, or given up."""
        self._done, self._last_tick = self._done + 1, -1
        self._bars.update(self._task, completed=self._done)


def _bars(console: Console, *, hidden: bool) -> Progress:
    columns = (
        TextColumn("{task.fields[what]}"),
        BarColumn(bar_width=None),
        TextColumn("{task.completed:.1f}/{task.fields[scenes]} scenes"),
        TextColumn("{task.fields[speed]}", style="progress.data.speed"),
        TextColumn("{task.fields[used]}", style="progress.filesize"),
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=console, expand=True, disable=hidden)
