"""The folder that scenes are recorded into: held against other writers, never overwritten, cleared of leftovers."""

import shutil
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path

from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.lock import DatasetLock
from simbev_ros.dataset.plan import Plan, bag_of
from simbev_ros.foundation.errors import BagError, InputError
from simbev_ros.foundation.files.whole_files import require_writable, write_errors
from simbev_ros.production.events import LeftoverRemoved
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.recording.bag_files import check_space, disk_error_consequence
from simbev_ros.recording.layout import CONFIG_ATTACHMENT, partial_of, scene_folder, scenes_folder
from simbev_ros.recording.reader import SceneBag
from simbev_ros.schema.scene.spec import SceneSpec


@contextmanager
def hold_record_folder(
    dataset: Path,
    scenario: Scenario,
    specs: Sequence[SceneSpec],
    *,
    live: bool,
    observer: ProductionObserver = SILENT,
) -> Iterator[None]:
    """Hold a dataset while scenes are recorded into it; see ``hold_bags``."""
    bags = {scene_folder(dataset, spec.split, spec.name): spec for spec in specs}
    with hold_bags(dataset, scenario, bags, bags.__getitem__, live=live, observer=observer):
        yield


@contextmanager
def hold_bags(
    dataset: Path,
    scenario: Scenario,
    bags: Collection[Path],
    spec_of: Callable[[Path], SceneSpec],
    *,
    live: bool,
    observer: ProductionObserver = SILENT,
) -> Iterator[None]:
    """Hold a dataset while scenes are recorded into it, and remove leftovers that the recording reproduces exactly.

    At the end, also after an error, all finished scenes are in the dataset's plan and in its index.

    Args:
        dataset: The dataset's folder.
        scenario: The configuration.
        bags: Folders of the scenes' finished bags.
        spec_of: Returns the scene of a bag; it is called for leftovers only.
        live: Whether the recording is paced by the wall clock.
        observer: Receives the progress.

    Raises:
        InputError: The folder cannot be made or written to, another process records into it, its plan or index is
            damaged, a scene exists already, or an unfinished bag of a scene exists that this recording would not
            reproduce.
        DiskError: The disk is nearly full.
    """
    from simbev_ros.dataset.index import load_index  # pyarrow takes long to load

    for bag in bags:
        if bag.exists():
            raise InputError(f"{bag}: exists already; nothing was overwritten. Choose another folder or move it away")
    with DatasetLock(dataset):
        leftovers = {unfinished: spec_of(bag) for bag in bags if (unfinished := partial_of(bag)).exists()}
        for unfinished, spec in leftovers.items():
            if live or not _is_reproduced(unfinished, scenario, spec):
                raise InputError(
                    f"{unfinished}: an earlier run has recorded this until something ended it, and it would not come "
                    f"back the same. simbev repair {unfinished} saves what is in it; then remove or rename it"
                )
        for unfinished, spec in leftovers.items():
            shutil.rmtree(unfinished)
            observer.notify(LeftoverRemoved(spec.name))
        require_writable(dataset)
        with write_errors(dataset):
            scenes_folder(dataset).mkdir(exist_ok=True)
        check_space(dataset, scenario.recording.min_free_mib << 20)
        load_index(dataset)  # whether it can be read
        Plan.load(dataset)
        try:
            yield
        finally:
            _list_finished(dataset)


def _list_finished(dataset: Path) -> None:
    """Write all finished scenes into the plan and the index of a dataset, if there are any."""
    from simbev_ros.dataset.index import update_index

    plan = Plan.load(dataset)
    if finished := plan.finished_entries(dataset):
        plan.save(dataset)
        update_index(dataset, (bag_of(dataset, entry) for entry in finished))


@contextmanager
def keep_recorded(dataset: Path | None) -> Iterator[None]:
    """Context for recording into a folder from which nothing is removed when recording fails; None: without effect.

    Raises:
        DiskError: One was raised in the context; the message adds that everything is kept.
    """
    with nullcontext() if dataset is None else disk_error_consequence(f"what was recorded stays readable in {dataset}"):
        yield


def _is_reproduced(partial: Path, scenario: Scenario, spec: SceneSpec) -> bool:
    """Whether everything in an unfinished bag follows from the scene and the configuration that are to be recorded."""
    if not any(partial.iterdir()):
        return True
    try:
        with SceneBag(partial) as bag:
            config = bag.attachments.get(CONFIG_ATTACHMENT)
            return spec.is_driven_by_traffic and bag.spec == spec and config == scenario.as_yaml().encode()
    except BagError:
        return False
