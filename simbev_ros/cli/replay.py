"""``simbev replay``: plays recorded scenes with other sensors, other weather or another time of day."""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from simbev_ros.cli.console import make_console, plural
from simbev_ros.cli.evaluate.live import FiguresOption, StackOption, with_evaluation
from simbev_ros.config.load import load_scenario
from simbev_ros.errors import InputError
from simbev_ros.recording.layout import (
    additional_folder,
    dataset_of,
    is_dataset,
    is_scene,
    locate_mcap,
    scene_folder,
    scenes_of,
)
from simbev_ros.recording.whole_files import require_writable

if TYPE_CHECKING:
    from simbev_ros.config.scenario import Scenario
    from simbev_ros.production.observer import ProductionObserver
    from simbev_ros.scene.spec import SceneSpec


def replay(
    bags: Annotated[
        list[Path], typer.Argument(help="Scenes' bags, their .mcap files, or datasets.", show_default=False)
    ],
    config: Annotated[str, typer.Argument(help="Configuration file: rig, annotation, weather.", show_default=False)],
    record: Annotated[
        Path | None, typer.Option("--record", "--out", help="Record the scenes as bags in this dataset folder.")
    ] = None,
    merge: Annotated[
        str | None,
        typer.Option(help="Record each scene as an additional bag beside its own, <scene>.LABEL.", metavar="LABEL"),
    ] = None,
    live: Annotated[bool, typer.Option("--live", help="In real time; sensor topics are best effort.")] = False,
    evaluate: FiguresOption = None,
    stack: StackOption = None,
) -> None:
    """Play recorded scenes with exactly the same motion, on the same topics and stamps.

    Rig and annotation come from the configuration, as do weather and lights if it has these sections; everything else
    comes from the bags. Of a dataset only scenes that are not recorded yet are played: after Ctrl-C the same command
    continues where it stopped.

    [bold]Examples[/]

    simbev replay out/demo/scenes/train/Blocks-0000 night.yaml --out datasets/night

    simbev replay datasets/first rear_cameras.yaml --merge rear
    """
    from simbev_ros.cli.production_display import SceneDisplay
    from simbev_ros.production.play import play_specs

    if merge is not None and (record is not None or live):
        raise InputError("--merge records beside the replayed bags; give neither --out nor --live with it")
    scenario, console = with_evaluation(load_scenario(config), evaluate, stack), make_console()
    if record is not None:
        require_writable(record)
    found = _bags_to_replay(bags, record, merge, console)
    if not found:
        return
    folders = [locate_mcap(bag).resolve().parent for bag in found]
    display = SceneDisplay(console)
    with _record_folder(record, folders, merge) as dataset:
        specs = [_replayed_spec(bag, scenario, display) for bag in found]
        _refuse_duplicates(specs, dataset)
        playing = play_specs(scenario, specs, live=live, dataset=dataset, replays=found, observer=display)
        with closing(playing) as scenes:
            for folder, recorded in zip(folders, scenes, strict=True):
                bag = recorded if merge is None else recorded.rename(additional_folder(folder, merge))
                if dataset is not None:
                    console.print(f"recorded {bag}", highlight=False, soft_wrap=True)


def _bags_to_replay(paths: Sequence[Path], record: Path | None, merge: str | None, console: Console) -> list[Path]:
    """The bags among the paths, and the scenes of the datasets among them that are not recorded yet."""
    wanted = [bag for path in paths for bag in (_scenes(path) if is_dataset(path) else [path])]
    done = [bag for path in paths if is_dataset(path) for bag in _scenes(path) if _is_recorded(bag, record, merge)]
    if done:
        console.print(f"{plural(len(done), 'scene')} recorded before", highlight=False)
    return [bag for bag in wanted if bag not in done]


def _scenes(dataset: Path) -> list[Path]:
    """The finished scenes of a dataset.

    Raises:
        InputError: It has none.
    """
    bags = [bag for bag in scenes_of(dataset) if is_scene(bag)]
    if not bags:
        raise InputError(f"{dataset}: there is no finished scene to replay")
    return bags


def _is_recorded(bag: Path, record: Path | None, merge: str | None) -> bool:
    """Whether the bag that replaying a dataset's scene would record exists."""
    if merge is not None:
        return additional_folder(bag, merge).exists()
    return record is not None and scene_folder(record, bag.parent.name, bag.name).exists()


@contextmanager
def _record_folder(record: Path | None, folders: Sequence[Path], label: str | None) -> Iterator[Path | None]:
    """The folder to record into, None if there is none.

    If the bags get a label, it is the folder for unfinished scenes of the dataset that contains them all, which is held
    meanwhile.

    Raises:
        DiskError: The disk is full, or nearly; the message says what was kept.
        InputError: A bag is not in the same dataset as the first one, or has an additional bag with this label.
    """
    from simbev_ros.dataset.lock import DatasetLock
    from simbev_ros.dataset.staging import ON_FULL_DISK, clean_up_staging, staging_of
    from simbev_ros.production.record_folder import keep_recorded
    from simbev_ros.recording.bag_files import disk_error_consequence

    if label is None:
        with keep_recorded(record):
            yield record
        return

    for folder in folders:
        if not is_scene(folder) or dataset_of(folder) is None or dataset_of(folder) != dataset_of(folders[0]):
            raise InputError(f"--merge: {folder}: is not a finished scene of the dataset that gets the bags")
        if additional_folder(folder, label).exists():
            raise InputError(f"{additional_folder(folder, label)}: exists already; nothing was overwritten")
    dataset = dataset_of(folders[0])
    assert dataset is not None, "checked above"
    with DatasetLock(dataset), disk_error_consequence(ON_FULL_DISK):
        clean_up_staging(dataset)
        try:
            yield staging_of(dataset)
        finally:
            clean_up_staging(dataset)


def _refuse_duplicates(specs: "Sequence[SceneSpec]", dataset: Path | None) -> None:
    """Refuse to record two bags of the same scene into one dataset."""
    counts = Counter((spec.split, spec.name) for spec in specs)
    duplicates = [name for (_, name), count in counts.items() if count > 1]
    if duplicates and dataset is not None:
        raise InputError(
            f"{duplicates[0]}: two of the bags are of this scene, and one dataset has room for one of them"
        )


def _replayed_spec(bag: Path, scenario: "Scenario", observer: "ProductionObserver") -> "SceneSpec":
    """The scene that a bag is replayed as; errors of the bag are raised before the graph starts."""
    from simbev_ros.production.surroundings import load_roads
    from simbev_ros.recording.reader import SceneBag
    from simbev_ros.recording.replay import Replay, build_recorded_roads, replayed_spec

    with SceneBag(bag) as recorded:
        chosen = build_recorded_roads(recorded)
        spec = replayed_spec(recorded, scenario, load_roads(chosen, observer), chosen)
    Replay(spec, bag).close()
    return spec
