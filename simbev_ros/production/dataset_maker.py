"""Making the scenes of a dataset one after the other, with retries; a scene that fails does not stop the others."""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.index import Row, index_row, update_index, write_index
from simbev_ros.dataset.plan import Plan, PlannedEntry, bag_of
from simbev_ros.dataset.staging import ON_FULL_DISK, move_into_dataset, staging_of
from simbev_ros.errors import DiskError, GraphError, InputError, SimbevError
from simbev_ros.graph.session import GraphSession
from simbev_ros.graph.traces import sweep
from simbev_ros.production.drawing import PlannedSceneDrawer
from simbev_ros.production.observer import SILENT, ProductionObserver, observe_step
from simbev_ros.production.play import play_on
from simbev_ros.production.scene_log import SceneLog
from simbev_ros.production.surroundings import build_surroundings
from simbev_ros.recording.bag_files import check_space, disk_error_consequence


@dataclass(slots=True)
class Outcome:
    """The scenes that were made, and by the name of each scene that failed or is damaged the reason."""

    made: list[PlannedEntry] = field(default_factory=list)
    failed: dict[str, str] = field(default_factory=dict)
    damaged: dict[str, str] = field(default_factory=dict)


class DatasetMaker:
    """Makes scenes on a graph that starts with the first scene and restarts after it has failed.

    The caller holds the dataset's lock. As a context manager it stops the graph.

    Args:
        scenario: The configuration.
        dataset: The dataset's folder; its index is brought up to date with the bags in it.
        retries: Number of further attempts at a scene after the graph has failed.
        observer: Receives the progress.
    """

    def __init__(
        self, scenario: Scenario, dataset: Path, *, retries: int, observer: ProductionObserver = SILENT
    ) -> None:
        self._scenario, self._dataset, self._retries, self._observer = scenario, dataset, retries, observer
        self._drawer = PlannedSceneDrawer(scenario, observer)
        self._session: GraphSession | None = None
        sweep()  # also where nothing is left to make
        existing = [bag for bag in (bag_of(dataset, entry) for entry in Plan.load(dataset).scenes) if bag.is_dir()]
        with observe_step(observer, "reading the scenes that are there"):
            rows, self._damaged = update_index(dataset, existing)
        self._rows: dict[int, Row] = {row["number"]: row for row in rows}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop the graph and remove what it has not finished."""
        self._stop_graph()
        shutil.rmtree(staging_of(self._dataset), ignore_errors=True)

    def make(self, entries: Sequence[PlannedEntry]) -> Outcome:
        """Make scenes; failures are collected, as are the damaged bags of the dataset that remain.

        Raises:
            InputError: The first scene cannot be made with this configuration.
            DiskError: The disk is full, or nearly; the scenes made before are complete.
        """
        outcome = Outcome()
        self._observer.dataset_started(len(entries), self._dataset_bytes)
        try:
            with disk_error_consequence(ON_FULL_DISK):
                for entry in entries:
                    self._check_space()
                    self._add_to(outcome, entry)
        finally:
            self._observer.dataset_ended()
        outcome.damaged.update((bag.name, problem) for bag, problem in self._damaged.items())
        return outcome

    def _add_to(self, outcome: Outcome, entry: PlannedEntry) -> None:
        """Make a scene, or note why it failed."""
        try:
            row = self._make_scene(entry)
        except DiskError:
            raise
        except SimbevError as error:
            if isinstance(error, InputError) and not outcome.made and not outcome.failed:
                raise
            outcome.failed[entry.name] = str(error)
            self._observer.scene_failed(entry, str(error))
            return
        self._rows[entry.number] = row
        write_index(self._dataset, self._rows.values())
        outcome.made.append(entry)
        self._damaged.pop(bag_of(self._dataset, entry), None)
        self._observer.scene_made(entry, self._dataset_bytes)

    @property
    def _dataset_bytes(self) -> int:
        return sum(row["bytes"] for row in self._rows.values())

    def _make_scene(self, entry: PlannedEntry) -> Row:
        """Make a scene, move it into the dataset and return its row of the index."""
        spec = self._drawer.draw(entry)
        build_surroundings([spec], self._observer)
        for attempt in range(self._retries + 1):
            log = SceneLog(self._dataset, spec.name, attempt)
            shutil.rmtree(bag_of(staging_of(self._dataset), entry).parent, ignore_errors=True)
            try:
                end = play_on(self._running_session(), spec, self._observer)
            except GraphError as error:
                log.close(str(error), self._stop_graph(), failed=True)
                if attempt == self._retries:
                    raise
                self._observer.scene_retried(spec, str(error))
                continue
            row = index_row(move_into_dataset(self._dataset, entry), self._dataset)
            log.close(f"{end.reason} after tick {end.tick}, {row['bytes']:,} bytes", self._new_output())
            return row
        raise AssertionError("the last attempt returns or raises")

    def _running_session(self) -> GraphSession:
        if self._session is None:
            session = GraphSession(self._scenario, dataset=staging_of(self._dataset))
            session.start()
            self._session = session
        return self._session

    def _new_output(self) -> dict[str, str]:
        return {} if self._session is None else self._session.new_output()

    def _stop_graph(self) -> dict[str, str]:
        """Stop the graph, if it runs, and return what its processes have written since the last call."""
        output = self._new_output()
        if self._session is not None:
            self._session.close()
            self._session = None
        return output

    def _check_space(self) -> None:
        """Refuse to begin a scene that may not fit.

        Raises:
            DiskError: Less is free than the largest scene so far takes plus what must stay free.
        """
        largest = max((row["bytes"] for row in self._rows.values()), default=0)
        check_space(self._dataset, self._scenario.recording.min_free_mib << 20, largest)
