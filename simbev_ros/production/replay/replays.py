"""Recording replays with the driver of production: the core of ``simbev replay`` with workers or a cluster."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.plan import PlannedEntry, bag_of
from simbev_ros.dataset.staging import clean_up_staging
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.whole_files import require_writable
from simbev_ros.production.cluster.node_check import check_nodes
from simbev_ros.production.cluster.ray_cluster import RayCluster
from simbev_ros.production.dataset import check_workers, open_worker_pool
from simbev_ros.production.dataset_maker import DatasetMaker
from simbev_ros.production.dataset_storage import lock_dataset
from simbev_ros.production.observer import SILENT, ProductionObserver, SeveralObservers
from simbev_ros.production.record_folder import hold_bags
from simbev_ros.production.replay.entry import ReplayedEntry, checked_scene, replayed_scene, require_distinct
from simbev_ros.production.replay.selection import folder_of, require_mergeable, select_bags
from simbev_ros.production.replay.storage import ReplayStorage
from simbev_ros.production.workers.ray_metrics import RayMetrics
from simbev_ros.recording.layout import additional_folder
from simbev_ros.schema.scene.spec import SceneSpec


@dataclass(frozen=True, slots=True)
class ReplayResult:
    """The result of ``replay_bags``.

    Attributes:
        recorded: Bags that were recorded.
        existing: Bags of replays that existed before and were left as they are.
        failed: For the name of each scene with a failed replay, the reason.
    """

    recorded: tuple[Path, ...]
    existing: tuple[Path, ...]
    failed: Mapping[str, str]

    @property
    def is_complete(self) -> bool:
        """Whether no replay failed."""
        return not self.failed


def replay_bags(
    scenario: Scenario | Path | str,
    bags: Sequence[Path | str],
    *,
    out: Path | str | None = None,
    merge: str | None = None,
    retries: int = 2,
    workers: int | Literal["auto"] | None = None,
    ray: str | None = None,
    observer: ProductionObserver = SILENT,
) -> ReplayResult:
    """Record bags again with the rig and annotation of a configuration, and with its weather and lights if it has any.

    Of datasets only scenes without a recorded replay are played, so that the same call continues after an
    interruption. All bags are checked before anything is recorded. A replay that fails is retried, then listed, and
    the others follow.

    Args:
        scenario: The configuration, its file, or the name of a shipped one.
        bags: Scenes' bags, their MCAP files, or datasets.
        out: Dataset to record into, new or begun.
        merge: Label of additional bags of the scenes to record, in place of ``out``.
        retries: Number of further attempts at a replay after the graph has failed.
        workers: See ``make_dataset``.
        ray: Address of a Ray cluster; its nodes see the bags and the dataset that is written to. See ``make_dataset``.
        observer: Receives the progress.

    Raises:
        InputError: The configuration, a bag, a label or a number is wrong, a replay exists already, the dataset cannot
            be written to, another process writes into it, or the first replay cannot be made.
        DiskError: The disk is full, or nearly; the replays recorded before are complete.

    Example:
        >>> from simbev_ros.production import replay_bags
        >>> result = replay_bags("night.yaml", ["datasets/first"], out="datasets/night", workers=4)
        >>> print(len(result.recorded), "recorded,", dict(result.failed))
    """
    loaded = (scenario if isinstance(scenario, Scenario) else load_scenario(scenario)).for_replay()
    out = None if out is None else Path(out)
    check_workers(workers, ray)
    _require_recordable(loaded, out, merge)
    selection = select_bags([Path(bag) for bag in bags], out, merge)
    if not selection.bags:
        return ReplayResult((), tuple(selection.recorded), {})
    place = out or require_mergeable([folder_of(bag) for bag in selection.bags], merge or "")
    with ExitStack() as held:
        cluster = None if ray is None else held.enter_context(RayCluster(ray))
        if cluster is not None:
            check_nodes(cluster, place, reads=selection.bags)
            observer = SeveralObservers(observer, RayMetrics(place.name))
        entries = [ReplayedEntry.of(checked_scene(bag, loaded, observer), bag) for bag in selection.bags]
        require_distinct(entries)
        targets: dict[PlannedEntry, Path] = {entry: _target(entry, out, merge) for entry in entries}
        replayed = {targets[entry]: entry.bag for entry in entries}
        held.enter_context(lock_dataset(place) if out is None else _hold_dataset(place, loaded, replayed, observer))
        min_free_bytes = loaded.recording.min_free_mib << 20
        storage = held.enter_context(closing(ReplayStorage(place, targets, selection.recorded, min_free_bytes)))
        pool = open_worker_pool(loaded, place, storage, workers, cluster, len(entries), observer, maps=())
        outcome = DatasetMaker(storage, held.enter_context(pool), retries=retries, observer=observer).make(entries)
    return ReplayResult(tuple(targets[entry] for entry in outcome.made), tuple(selection.recorded), outcome.failed)


def _require_recordable(scenario: Scenario, out: Path | None, merge: str | None) -> None:
    """Check the requested replays and their destination."""
    if (out is None) == (merge is None):
        raise InputError(
            "replays are recorded either into a dataset or as additional bags of their scenes: give out or merge"
        )
    if scenario.evaluated_agents:
        raise InputError("evaluation: several graphs evaluate no stack; remove the section, or replay on one graph")
    if out is not None:
        require_writable(out)


def _target(entry: ReplayedEntry, out: Path | None, label: str | None) -> Path:
    """Folder that the bag of a replay gets."""
    return additional_folder(folder_of(entry.bag), label or "") if out is None else bag_of(out, entry)


@contextmanager
def _hold_dataset(
    out: Path, scenario: Scenario, replayed: Mapping[Path, Path], observer: ProductionObserver
) -> Iterator[None]:
    """Hold the dataset that replays are recorded into, and remove what earlier runs have left of them.

    Args:
        out: The dataset.
        scenario: The configuration.
        replayed: For the folder that each replay gets the bag with its motion.
        observer: Receives the progress.
    """

    def spec_of(target: Path) -> SceneSpec:
        return replayed_scene(replayed[target], scenario, observer)

    with hold_bags(out, scenario, replayed, spec_of, live=False, observer=observer):
        clean_up_staging(out)
        yield
