"""Names that scenes have in the tables: their own, numbers as the devkit's CAN bus API demands, or nuScenes' own names.

Converters of other projects split a dataset by lists of nuScenes' scene names, which ``scene_names.yaml`` contains.
"""

from collections.abc import Sequence
from enum import StrEnum
from functools import lru_cache

from simbev_ros.config.scenario import SPLITS
from simbev_ros.dataset import Scene
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.tables import load_table

_FIRST_NUMBER, _LAST_NUMBER = 2000, 9999


class SceneNames(StrEnum):
    """How scenes are named."""

    OWN = "own"
    DEVKIT = "devkit"
    NUSCENES = "nuscenes"


def published_names(scenes: Sequence[Scene], names: SceneNames) -> dict[str, str]:
    """Names of scenes in the tables, by their own names.

    With ``NUSCENES``, the scenes of a split get the names of nuScenes' split one after the other, by their numbers.

    Raises:
        InputError: There are more scenes than names, or a scene's number is too large.
    """
    match names:
        case SceneNames.OWN:
            return {scene.name: scene.name for scene in scenes}
        case SceneNames.DEVKIT:
            return {scene.name: _devkit_name(scene) for scene in scenes}
        case SceneNames.NUSCENES:
            return {name: each for split in SPLITS for name, each in _names_of_split(scenes, split).items()}


def numbered(number: int) -> str:
    """Name that the devkit demands of a scene, behind the numbers of nuScenes' own scenes."""
    return f"scene-{_FIRST_NUMBER + number}"


def _devkit_name(scene: Scene) -> str:
    most = _LAST_NUMBER - _FIRST_NUMBER
    if scene.number > most:
        raise InputError(
            f"{scene.path}: scene {scene.number} cannot have a name of the devkit's; numbers up to {most} can",
            parameter="scene_names",
        )
    return numbered(scene.number)


def _names_of_split(scenes: Sequence[Scene], split: str) -> dict[str, str]:
    own = [scene.name for scene in sorted(scenes, key=lambda scene: scene.number) if scene.split == split]
    known = nuscenes_scenes()[split]
    if len(own) > len(known):
        raise InputError(
            f"nuscenes has {len(known)} names for the split {split}, which has {len(own)} scenes; allowed then: "
            f"{SceneNames.OWN}, {SceneNames.DEVKIT}",
            parameter="scene_names",
        )
    return dict(zip(own, known, strict=False))


@lru_cache(maxsize=1)
def nuscenes_scenes() -> dict[str, list[str]]:
    """Names of nuScenes' own scenes by split."""
    table = load_table("simbev_exporters.nuscenes", "scene_names.yaml")
    ranges = {split: [each.split("-") for each in text.split(", ")] for split, text in table.items()}
    return {
        split: [f"scene-{number:04d}" for ends in found for number in range(int(ends[0]), int(ends[-1]) + 1)]
        for split, found in ranges.items()
    }
