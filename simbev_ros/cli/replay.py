"""``simbev replay``: recorded scenes once more, with other sensors, another weather or another time of day."""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from simbev_ros.config.load import load_scenario
from simbev_ros.errors import InputError
from simbev_ros.recording.layout import additional_folder, dataset_of, is_dataset, is_scene, locate_mcap, scenes_of

if TYPE_CHECKING:
    from simbev_ros.config.scenario import Scenario
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
) -> None:
    """Play recorded scenes with exactly the same motion, on the same topics and stamps.

    Rig and annotation are the configuration's, and weather and lights if it has these sections; all else is the bags'.

    [bold]Examples[/]

    simbev replay out/demo/scenes/train/Blocks-0000 night.yaml --out datasets/night

    simbev replay datasets/first rear_cameras.yaml --merge rear
    """
    from simbev_ros.cli.scenes import played

    if merge is not None and (record is not None or live):
        raise InputError("--merge records beside the replayed bags; give neither --out nor --live with it")
    scenario, console = load_scenario(config), Console()
    found = [bag for path in bags for bag in (_finished(path) if is_dataset(path) else [path])]
    folders = [locate_mcap(bag).resolve().parent for bag in found]
    with _merging(folders, merge) as staging:
        specs = [_spec(bag, scenario, console) for bag in found]
        _refuse_twins(specs, record or staging)
        with closing(played(scenario, specs, console, live=live, dataset=record or staging, replays=found)) as scenes:
            for folder, recorded in zip(folders, scenes, strict=True):
                place = recorded if merge is None else recorded.rename(additional_folder(folder, merge))
                if record is not None or merge is not None:
                    console.print(f"recorded {place}", highlight=False, soft_wrap=True)


def _finished(dataset: Path) -> list[Path]:
    return [bag for bag in scenes_of(dataset) if is_scene(bag)]


@contextmanager
def _merging(folders: Sequence[Path], label: str | None) -> Iterator[Path | None]:
    """Hold the dataset that all bags are in, if they get a label; give the folder in it where scenes are made.

    Raises:
        InputError: A bag is not in a dataset, or in another one than the first, or has an additional bag of this label.
    """
    if label is None:
        yield None
        return
    from simbev_ros.dataset.lock import DatasetLock
    from simbev_ros.dataset.staging import clean_up, staging_of

    for folder in folders:
        if not is_scene(folder) or dataset_of(folder) is None or dataset_of(folder) != dataset_of(folders[0]):
            raise InputError(f"--merge: {folder}: is not a finished scene of the dataset that gets the bags")
        if additional_folder(folder, label).exists():
            raise InputError(f"{additional_folder(folder, label)}: exists already; nothing was overwritten")
    dataset = dataset_of(folders[0]) if folders else None
    if dataset is None:
        raise InputError("--merge: there is no finished scene to replay")
    with DatasetLock(dataset):
        clean_up(dataset)
        try:
            yield staging_of(dataset)
        finally:
            clean_up(dataset)


def _refuse_twins(specs: "Sequence[SceneSpec]", dataset: Path | None) -> None:
    """Two bags of one scene cannot be recorded into one dataset."""
    counts = Counter((spec.split, spec.name) for spec in specs)
    twins = [name for (_, name), count in counts.items() if count > 1]
    if twins and dataset is not None:
        raise InputError(f"{twins[0]}: two of the bags are of this scene, and one dataset has room for one of them")


def _spec(bag: Path, scenario: "Scenario", console: Console) -> "SceneSpec":
    """The scene that a bag is replayed as; whatever is wrong with the bag is said before the graph starts."""
    from simbev_ros.cli.scenes import map_roads
    from simbev_ros.recording.reader import SceneBag
    from simbev_ros.recording.replay import Replay, load_recorded_roads, recorded_spec, replayed_spec

    with SceneBag(bag) as recorded:
        load_recorded_roads(recorded)
        spec = replayed_spec(recorded, scenario, map_roads(recorded_spec(recorded).map, console))
    Replay(spec, bag).close()
    return spec
