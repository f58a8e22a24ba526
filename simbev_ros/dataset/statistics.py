"""Statistics of a dataset, or of one bag: settings of its scenes, and counts over their frames.

Frames are read in parts, in as many processes as are wanted; of a large dataset only each so many-th frame of a scene.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from simbev_ros.dataset import Dataset, Scene, open_dataset
from simbev_ros.dataset.parallel import in_processes
from simbev_ros.dataset.tallies import Tally
from simbev_ros.errors import InputError
from simbev_ros.recording.layout import bytes_of
from simbev_ros.scene.weather import Weather
from simbev_ros.types import Float64Array, Int64Array
from simbev_ros.units import NS_PER_S

MOST_FRAMES = 20_000
"""How many are looked at."""

_FRAMES_PER_PART = 50


@dataclass(frozen=True, eq=False, slots=True)
class SceneFacts:
    """One scene.

    Attributes:
        frames: All that it has.
        duration_s: Of simulated time.
        file_bytes: Size of its bag.
        vehicles: As drawn, the ego included.
        boxes: In the frames that were looked at.
        looked_at: How many frames those are.
        way_m: How far the ego has gone, as far as those frames tell.
        ego_m: (looked_at, 2) where the ego was, map frame.
    """

    name: str
    number: int
    map: str
    split: str
    seed: int
    frames: int
    duration_s: float
    file_bytes: int
    vehicles: int
    pedestrians: int
    hazards: int
    weather: Weather
    boxes: int
    looked_at: int
    way_m: float
    ego_m: Float64Array


@dataclass(frozen=True, eq=False, slots=True)
class Statistics:
    """All that is known.

    Attributes:
        path: Of the dataset.
        scenes: By ascending number.
        every: Each so many-th frame of a scene was looked at.
        tally: Counts of all scenes together.
        visited: By map, (K, 2) cells of ``tallies.CELL_M`` in which actors were.
    """

    path: Path
    scenes: tuple[SceneFacts, ...]
    every: int
    tally: Tally
    visited: dict[str, Int64Array]


@dataclass(frozen=True, slots=True)
class _Part:
    """Some frames of a scene."""

    dataset: Path
    scene: Path
    first: int
    ticks: range


def statistics_of(
    dataset: Dataset, jobs: int = 1, progress: Callable[[int, int], None] = lambda done, total: None
) -> Statistics:
    """Look at the frames of a dataset.

    Args:
        dataset: At least one scene.
        jobs: Processes.
        progress: Called with the numbers of frames that were looked at, and that will be.

    Raises:
        InputError: There is no scene.
        BagError: A bag is damaged, or of another version.
    """
    if not any(len(scene) for scene in dataset.scenes):
        raise InputError(f"{dataset.path}: it has no finished scene")
    every = max(1, sum(len(scene) for scene in dataset.scenes) // MOST_FRAMES)
    parts = {scene.path: _parts(dataset, scene, every) for scene in dataset.scenes}
    work = [part for each in parts.values() for part in each]
    total, done = sum(len(part.ticks) for part in work), 0
    results = in_processes(_look, work, min(jobs, len(work)))
    whole, facts, visited = Tally(), [], dict[str, Int64Array]()
    for scene in dataset.scenes:
        tally = Tally()
        for part in parts[scene.path]:
            tally.join(next(results))
            done += len(part.ticks)
            progress(done, total)
        whole.add(tally)
        facts.append(_facts(scene, tally))
        known = visited.get(scene.map, tally.visited)
        visited[scene.map] = np.unique(np.concatenate([known, tally.visited]), axis=0)
    return Statistics(dataset.path, tuple(facts), every, whole, visited)


def _parts(dataset: Dataset, scene: Scene, every: int) -> list[_Part]:
    ticks = range(0, len(scene), every)
    firsts = range(0, len(ticks), _FRAMES_PER_PART)
    return [_Part(dataset.path, scene.path, first, ticks[first : first + _FRAMES_PER_PART]) for first in firsts]


def _look(part: _Part) -> Tally:
    scene = next(each for each in _opened(part.dataset).scenes if each.path == part.scene)
    return Tally.of([scene[tick] for tick in part.ticks], with_actors=part.first == 0)


@lru_cache(maxsize=1)
def _opened(path: Path) -> Dataset:
    return open_dataset(path, threads=1)


def _facts(scene: Scene, tally: Tally) -> SceneFacts:
    spec = scene.spec
    return SceneFacts(
        name=scene.name,
        number=scene.number,
        map=scene.map,
        split=scene.split,
        seed=spec.seed,
        frames=len(scene),
        duration_s=len(scene) * spec.tick_ns / NS_PER_S,
        file_bytes=bytes_of(scene.path),
        vehicles=len(spec.vehicles),
        pedestrians=len(spec.pedestrians),
        hazards=len(spec.hazards),
        weather=spec.weather,
        boxes=int(tally.counts["boxes"].sum()),
        looked_at=tally.frames,
        way_m=float(np.linalg.norm(np.diff(tally.ego_m, axis=0), axis=1).sum()),
        ego_m=tally.ego_m,
    )
