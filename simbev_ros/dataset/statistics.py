"""Statistics of a dataset, or of one bag: settings of its scenes, and counts over their frames.

Batches of frames are read in parallel; in a large dataset only every Nth frame of each scene is read.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from simbev_ros.dataset import Dataset, Scene, open_dataset
from simbev_ros.dataset.parallel import OWN_PROCESS, Pool
from simbev_ros.dataset.tallies import Tally
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.object_store.object_path import AnyPath
from simbev_ros.foundation.types import Float64Array, Int64Array, Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.recording.layout import bytes_of
from simbev_ros.schema.scene.state import COLLISION
from simbev_ros.schema.scene.weather import Weather

MAX_FRAMES = 20_000
"""Approximate upper limit on the number of frames that are read."""

_FRAMES_PER_BATCH = 50


@dataclass(frozen=True, eq=False, slots=True)
class SceneFacts:
    """Facts about one scene.

    Attributes:
        frames: Number of all frames of the scene.
        duration_s: Length of the scene in simulated time.
        file_bytes: Size of the scene's bag.
        vehicles: Number of vehicles drawn, including the ego.
        hazards: Number of hazard areas by kind; only kinds that there are.
        collisions: Number of collisions between actors.
        boxes: Number of boxes in the sampled frames.
        labeled_frames: Number of sampled frames with boxes.
        distance_m: Distance that the ego drove, measured along its positions in the sampled frames.
        moments: (K,) ``MOMENT_DTYPE``, one row per sampled frame.
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
    hazards: Mapping[str, int]
    collisions: int
    weather: Weather
    boxes: int
    labeled_frames: int
    distance_m: float
    moments: Table

    @property
    def ego_m(self) -> Float64Array:
        """(K, 2) known positions of the ego in the sampled frames, map frame."""
        return _known_positions(self.moments)


@dataclass(frozen=True, eq=False, slots=True)
class Statistics:
    """Statistics of a dataset.

    Attributes:
        path: The dataset's folder, or the bag.
        scenes: Facts about each scene, by ascending number.
        every: Every Nth frame of each scene was read.
        tally: Counts over all scenes together.
        visited: By map, (K, 2) indices of cells with side ``tallies.CELL_M`` that actors visited.
    """

    path: AnyPath
    scenes: tuple[SceneFacts, ...]
    every: int
    tally: Tally
    visited: dict[str, Int64Array]


@dataclass(frozen=True, slots=True)
class _Batch:
    """A batch of frames of a scene, which one worker reads.

    Attributes:
        dataset: The dataset's folder, or the bag.
        scene: The scene's bag.
        first: Index of the batch's first frame among the scene's sampled frames.
        ticks: Ticks of the frames.
    """

    dataset: AnyPath
    scene: AnyPath
    first: int
    ticks: range


def statistics_of(
    dataset: Dataset, pool: Pool = OWN_PROCESS, progress: Callable[[int, int], None] = lambda done, total: None
) -> Statistics:
    """Compute the statistics of a dataset from its frames.

    Args:
        dataset: A dataset with at least one scene.
        pool: Workers that read frames.
        progress: Called with the number of frames read so far and the number of frames that will be read.

    Raises:
        InputError: There is no scene.
        BagError: A bag is damaged, or of another version.
    """
    if not any(len(scene) for scene in dataset.scenes):
        raise InputError(f"{dataset.path}: it has no finished scene")
    every, labels = sum(map(len, dataset.scenes)) // MAX_FRAMES, dataset.scenes[0].view.label_period_ticks()
    every = next(n for n in range(max(1, every), 0, -1) if n % labels == 0 or labels % n == 0)
    batches = {scene.path: _batches(dataset, scene, every) for scene in dataset.scenes}
    work = [batch for each in batches.values() for batch in each]
    total, done = sum(len(batch.ticks) for batch in work), 0
    results = pool.map(_tally_batch, work)
    total_tally, facts, visited = Tally(), [], dict[str, Int64Array]()
    for scene in dataset.scenes:
        tally = Tally()
        for batch in batches[scene.path]:
            tally.append_frames(next(results))
            done += len(batch.ticks)
            progress(done, total)
        total_tally.add_counts(tally)
        facts.append(_scene_facts(scene, tally))
        known = visited.get(scene.map, tally.visited)
        visited[scene.map] = np.unique(np.concatenate([known, tally.visited]), axis=0)
    return Statistics(dataset.path, tuple(facts), every, total_tally, visited)


def _batches(dataset: Dataset, scene: Scene, every: int) -> list[_Batch]:
    ticks = range(0, len(scene), every)
    firsts = range(0, len(ticks), _FRAMES_PER_BATCH)
    return [_Batch(dataset.path, scene.path, first, ticks[first : first + _FRAMES_PER_BATCH]) for first in firsts]


def _tally_batch(batch: _Batch) -> Tally:
    scene = next(each for each in _open(batch.dataset).scenes if each.path == batch.scene)
    return Tally.from_frames([scene[tick] for tick in batch.ticks], with_actors=batch.first == 0)


@lru_cache(maxsize=1)
def _open(path: AnyPath) -> Dataset:
    return open_dataset(path, threads=1)


def _scene_facts(scene: Scene, tally: Tally) -> SceneFacts:
    spec, ego_m = scene.spec, _known_positions(tally.moments)
    return SceneFacts(
        name=scene.name,
        number=scene.number,
        map=scene.map,
        split=scene.split,
        seed=spec.seed,
        frames=len(scene),
        duration_s=len(scene) * spec.tick_ns / NS_PER_S,
        file_bytes=bytes_of(scene.path),
        vehicles=spec.count_of("vehicle"),
        pedestrians=spec.count_of("pedestrian"),
        hazards=Counter(hazard.kind.value for hazard in spec.hazards),
        collisions=sum(each.get("type") == COLLISION for each in scene.records("world/events")),
        weather=spec.weather,
        boxes=int(tally.counts["boxes"].sum()),
        labeled_frames=tally.labeled_frames,
        distance_m=float(np.linalg.norm(np.diff(ego_m, axis=0), axis=1).sum()),
        moments=tally.moments,
    )


def _known_positions(moments: Table) -> Float64Array:
    ego_m: Float64Array = moments["ego_m"]
    return ego_m[np.isfinite(ego_m).all(axis=1)]
