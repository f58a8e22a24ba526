"""Replays as workers are given them: entries that name the bag to take the motion from, and the scenes to play."""

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.foundation.errors import InputError
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.surroundings import load_roads
from simbev_ros.recording.reader import SceneBag
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.replay.replay import Replay, build_recorded_roads, replayed_spec


class ReplayedEntry(PlannedEntry):
    """A replay to record: number, map and split of the scene, and the absolute path of the bag with its motion."""

    bag: Path

    @classmethod
    def of(cls, spec: SceneSpec, bag: Path) -> "ReplayedEntry":
        """The replay of a bag as a scene."""
        return cls(number=spec.number, map=spec.map.name, split=spec.split, bag=bag.absolute())


def replayed_scene(bag: Path, scenario: Scenario, observer: ProductionObserver = SILENT) -> SceneSpec:
    """The scene that a bag is replayed as; the roads of its map are in the cache then.

    Raises:
        BagError: The bag is missing or damaged, holds no scene, or was recorded on other roads.
        InputError: The configuration has another tick length, or the map cannot be used.
    """
    with SceneBag(bag) as recorded:
        chosen = build_recorded_roads(recorded)
        return replayed_spec(recorded, scenario, load_roads(chosen, observer), chosen)


def checked_scene(bag: Path, scenario: Scenario, observer: ProductionObserver = SILENT) -> SceneSpec:
    """``replayed_scene`` for callers that play it later: what is wrong with the bag's motion is raised now.

    Raises:
        BagError: See ``replayed_scene``; or the motion in the bag cannot be replayed.
        InputError: See ``replayed_scene``.
    """
    spec = replayed_scene(bag, scenario, observer)
    Replay(spec, bag).close()
    return spec


def require_distinct(scenes: Iterable[SceneSpec | PlannedEntry]) -> None:
    """Refuse to record two bags of the same scene into one dataset.

    Raises:
        InputError: There are two.
    """
    counts = Counter((scene.split, scene.name) for scene in scenes)
    for (_, name), count in counts.items():
        if count > 1:
            raise InputError(f"{name}: two of the bags are of this scene, and one dataset has room for one of them")
