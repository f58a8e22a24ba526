"""Making a dataset from a configuration: the core of ``simbev generate``, for Python programs without a console."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.plan import Plan, PlannedEntry, bag_of
from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_ros.foundation.files.structured_text import parse_yaml
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath, path_or_url
from simbev_ros.production.cluster.node_check import check_nodes
from simbev_ros.production.cluster.ray_cluster import RayCluster
from simbev_ros.production.dataset_maker import DatasetMaker
from simbev_ros.production.dataset_storage import DatasetStorage, lock_dataset, open_storage
from simbev_ros.production.observer import SILENT, ProductionObserver, SeveralObservers, observe_step
from simbev_ros.production.workers.local_pool import LocalPool
from simbev_ros.production.workers.ray_metrics import RayMetrics
from simbev_ros.production.workers.ray_worker_pool import RayWorkerPool
from simbev_ros.production.workers.worker_pool import WorkerPool
from simbev_ros.recording.layout import CONFIG_ATTACHMENT
from simbev_ros.recording.reader import SceneBag
from simbev_ros.ros.graph.domain import ISOLATED_DOMAINS
from simbev_ros.scene.drawing.chosen_maps import maps_of
from simbev_ros.schema.scene.map_spec import MapSpec

_MAX_WORKERS = len(ISOLATED_DOMAINS)
"""Largest number of workers on one machine: each has a ROS domain of its own."""
_FREE_SECTIONS = frozenset({"scenes", "recording", "rendering", "graph", "evaluation"})
"""Sections that may change while a dataset grows: they change no content of scenes."""

Numbers = Sequence[int | range]
"""Numbers of scenes, single or as ranges."""


@dataclass(frozen=True, slots=True)
class DatasetResult:
    """The result of ``make_dataset``: which scenes were made, skipped, failed or found damaged.

    Attributes:
        path: The dataset.
        made: Scenes that were made.
        skipped: Scenes that existed before and were left as they are.
        failed: For the name of each scene that could not be made, the reason.
        damaged: For the name of each existing scene with a damaged bag, the reason; it was left as it is.
    """

    path: AnyPath
    made: tuple[PlannedEntry, ...]
    skipped: tuple[PlannedEntry, ...]
    failed: Mapping[str, str]
    damaged: Mapping[str, str]

    @property
    def is_complete(self) -> bool:
        """Whether no scene failed and none is damaged."""
        return not self.failed and not self.damaged


def make_dataset(
    scenario: Scenario | Path | str,
    out: AnyPath | str,
    *,
    replace: Numbers = (),
    retries: int = 2,
    workers: int | Literal["auto"] | None = None,
    ray: str | None = None,
    observer: ProductionObserver = SILENT,
) -> DatasetResult:
    """Make the scenes that a configuration asks for; scenes that exist already count.

    Interrupted at any moment, the same call continues where it stopped. All input is checked before anything is
    written. A scene that fails is retried, then listed, and the others follow. A perception stack in the
    configuration is not run.

    Args:
        scenario: The configuration, its file, or the name of a shipped one, such as ``paper``.
        out: The dataset, new or begun: a folder, or ``s3://bucket/prefix`` in an object store.
        replace: Numbers of the scenes to make again; no other scenes are made then.
        retries: Number of further attempts at a scene after the graph has failed.
        workers: Number of graphs that make scenes side by side, each in a process and a free ROS domain of its own;
            ``auto``: as many as this machine carries; None: one, in this process and in the domain of the environment.
        ray: Address of a Ray cluster that makes the scenes, ``HOST:PORT`` or ``auto``; its nodes see ``out``. None:
            this machine makes them.
        observer: Receives the progress.

    Raises:
        InputError: The configuration, a map or a number is wrong, the dataset cannot be written to, another process
            writes into it, or the first scene cannot be made with this configuration.
        DiskError: The disk is full, or nearly; the scenes made before are complete.

    Example:
        >>> from simbev_ros.production import make_dataset
        >>> result = make_dataset("my.yaml", "datasets/first")
        >>> print(len(result.made), "made,", len(result.skipped), "existed,", dict(result.failed))
    """
    scenario, out = without_stack(scenario), path_or_url(out)
    check_workers(workers, ray)
    plan_scenes(scenario, out, replace)
    with ExitStack() as held:
        cluster = None if ray is None else held.enter_context(RayCluster(ray))
        lock = held.enter_context(lock_dataset(out))
        if cluster is not None:
            check_nodes(cluster, *([] if isinstance(out, ObjectPath) else [out]))
            observer = SeveralObservers(observer, RayMetrics(out.name))
        plan, entries = plan_scenes(scenario, out, replace)
        plan.save(out)
        existing = plan.finished_entries(out)
        wanted = {entry.number for entry in entries}
        skipped = tuple(entry for entry in existing if entry.number not in wanted)
        with observe_step(observer, "reading the scenes that are there"):
            storage = held.enter_context(
                closing(open_storage(out, lock, existing, scenario.recording.min_free_mib << 20))
            )
        pool = held.enter_context(open_worker_pool(scenario, out, storage, workers, cluster, len(entries), observer))
        outcome = DatasetMaker(storage, pool, retries=retries, observer=observer).make(entries)
    skipped = tuple(entry for entry in skipped if entry.name not in outcome.damaged)
    return DatasetResult(out, tuple(outcome.made), skipped, outcome.failed, outcome.damaged)


def check_workers(workers: int | Literal["auto"] | None, ray: str | None) -> None:
    """Check the choice of workers.

    Raises:
        InputError: The number is not allowed, or there is a cluster as well; ``parameter`` is ``workers``.
    """
    if isinstance(workers, int) and not 1 <= workers <= _MAX_WORKERS:
        raise InputError(f"is {workers}; allowed: 1 to {_MAX_WORKERS}, or auto", parameter="workers")
    if workers is not None and ray is not None:
        raise InputError("is for this machine alone; a cluster has as many as there is room for", parameter="workers")


def open_worker_pool(
    scenario: Scenario,
    out: AnyPath,
    storage: DatasetStorage,
    workers: int | Literal["auto"] | None,
    cluster: RayCluster | None,
    scenes: int,
    observer: ProductionObserver,
    *,
    maps: Sequence[MapSpec] | None = None,
) -> WorkerPool:
    """The workers that make scenes, here or on a cluster.

    Args:
        scenario: The configuration.
        out: The dataset.
        storage: The same, open.
        workers: Number of workers on this machine; None: this process makes the scenes, unless there is a cluster.
        cluster: The cluster.
        scenes: Number of scenes to make.
        observer: Receives the progress.
        maps: Maps whose files a cluster's nodes need; None: those of the configuration.
    """
    if not scenes or (workers is None and cluster is None):
        from simbev_ros.production.workers.in_process_pool import InProcessPool  # loads what makes scenes

        return InProcessPool(scenario, storage.staging, observer, storage.uploader_for)
    if cluster is not None:
        shared = None if isinstance(out, ObjectPath) else storage.staging
        return RayWorkerPool(cluster, scenario, shared, scenes, observer, storage.uploader_for, maps=maps)
    return LocalPool(scenario, storage.staging, workers or "auto", scenes, observer, storage.uploader_for)


def plan_scenes(scenario: Scenario, out: AnyPath, replace: Numbers = ()) -> tuple[Plan, list[PlannedEntry]]:
    """The plan of a dataset extended by what a configuration asks for, and the scenes that have to be made.

    Raises:
        InputError: The dataset's plan is damaged, a map does not exist, or a number to replace has no scene.
    """
    maps = maps_of(scenario)
    plan = Plan.load(out).with_scenes_of(scenario, maps)
    numbers = [number if isinstance(number, range) else range(number, number + 1) for number in replace]
    return plan, plan.entries_with_numbers(numbers) if numbers else plan.missing_entries(out, scenario, maps)


def changed_sections(scenario: Scenario, out: AnyPath) -> list[str]:
    """Sections of a configuration that differ from those with which a dataset's first scene was made.

    Empty for a new dataset, for one in an object store, and if that scene's configuration cannot be read.
    """
    existing = [] if isinstance(out, ObjectPath) else Plan.load(out).finished_entries(out)
    if not existing:
        return []
    try:
        with foreign_content(out), SceneBag(bag_of(out, existing[0])) as bag:
            stored = parse_yaml(bag.attachments[CONFIG_ATTACHMENT])
            before = Scenario.model_validate(stored).model_dump(mode="json")
    except InputError:  # `verify` says what is wrong with it
        return []
    now = without_stack(scenario).model_dump(mode="json")
    return [name for name in now if name not in _FREE_SECTIONS and now[name] != before[name]]


def without_stack(scenario: Scenario | Path | str) -> Scenario:
    """The configuration, loaded if it is a path or name, without perception stacks: production runs none."""
    loaded = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    agents = tuple(agent.model_copy(update={"evaluation": None}) for agent in loaded.agents)
    return loaded.model_copy(update={"evaluation": None, "agents": agents})
