"""The place of scenes that are to be recorded: nothing is overwritten, and what a dead run has left is in no way."""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console

from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.lock import DatasetLock
from simbev_ros.errors import BagError, InputError
from simbev_ros.recording.bag_files import check_space
from simbev_ros.recording.layout import CONFIG_ATTACHMENT, partial_of, scene_folder, scenes_folder
from simbev_ros.recording.reader import SceneBag
from simbev_ros.scene.spec import SceneSpec


@contextmanager
def held_place(
    dataset: Path, scenario: Scenario, specs: Sequence[SceneSpec], console: Console, *, live: bool
) -> Iterator[None]:
    """Hold a dataset as long as scenes are recorded into it, and remove what this run makes again in any case.

    Raises:
        InputError: The folder cannot be made or written to, another process records into it, a scene is there, or the
            part of one that was recorded until something ended it, and that could not be made again as it is.
        DiskError: The disk is nearly full.
    """
    places = [scene_folder(dataset, spec.split, spec.name) for spec in specs]
    for place in places:
        if place.exists():
            raise InputError(f"{place}: exists already; nothing was overwritten. Choose another folder or move it away")
    with DatasetLock(dataset):
        left = [(partial_of(place), spec) for place, spec in zip(places, specs, strict=True)]
        left = [(partial, spec) for partial, spec in left if partial.exists()]
        for partial, spec in left:
            if live or not _is_made_again(partial, scenario, spec):
                raise InputError(
                    f"{partial}: an earlier run has recorded this until something ended it, and it would not come back "
                    f"the same. simbev repair {partial} saves what is in it; then remove or rename it"
                )
        for partial, spec in left:
            shutil.rmtree(partial)
            console.print(f"{spec.name}: a run that was ended has left a part of it; it is made anew", soft_wrap=True)
        _make_writable(dataset)
        check_space(dataset, scenario.recording.least_free_mib << 20)
        yield


def _is_made_again(partial: Path, scenario: Scenario, spec: SceneSpec) -> bool:
    """Whether all that is in an unfinished bag follows from the scene and the configuration that are to be recorded."""
    if not any(partial.iterdir()):
        return True
    try:
        with SceneBag(partial) as bag:
            config = bag.attachments.get(CONFIG_ATTACHMENT)
            return spec.ego_driver == "traffic" and bag.spec == spec and config == scenario.as_yaml().encode()
    except BagError:
        return False


def _make_writable(dataset: Path) -> None:
    try:
        scenes_folder(dataset).mkdir(parents=True, exist_ok=True)
        probe = dataset / ".writable"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(f"{dataset}: cannot be written to: {error.strerror}") from None
