"""Entry points for reading: ``open_dataset`` opens a dataset or a single bag as scenes and frames."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, overload

import numpy as np

from simbev_ros.config.scenario import SPLITS
from simbev_ros.dataset.frame import Frame
from simbev_ros.dataset.index import indexed_bags, read_index
from simbev_ros.dataset.scene import Scene
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath, path_or_url
from simbev_ros.recording.layout import bytes_of, finished_scenes, is_dataset, locate_mcap
from simbev_ros.recording.mcap.chunk_cache import ChunkCache

CACHE_BYTES = 256 << 20
"""Default size of the cache of decompressed chunks, in each process."""


class Dataset:
    """The scenes of a dataset, or of a single bag, ready to be read.

    Attributes:
        path: The dataset's folder, or the bag.
        scenes: The scenes by ascending number.
    """

    def __init__(self, path: AnyPath, scenes: Sequence[Scene]) -> None:
        self.path, self.scenes = path, tuple(scenes)

    def scene(self, name: str) -> Scene:
        """Scene with the given name.

        Raises:
            KeyError: There is no such scene.
        """
        for scene in self.scenes:
            if scene.name == name:
                return scene
        raise KeyError(f"{self.path}: no scene {name!r}")

    @property
    def agents(self) -> tuple[str, ...]:
        """Names of the agents of all scenes, in the order in which scenes list them.

        Raises:
            BagError: A scene cannot be read.
        """
        return tuple(dict.fromkeys(name for scene in self.scenes for name in scene.agents))

    def of_agent(self, name: str) -> "Dataset":
        """The scenes that have an agent, as it sees them.

        Raises:
            InputError: No scene has this agent.
            BagError: A scene cannot be read.
        """
        return Dataset(self.path, _scenes_of_agent(self.scenes, name))

    def frames(
        self,
        split: str | None = None,
        keys: Collection[str] = (),
        maps: Collection[str] | None = None,
        every: int = 1,
        agent: str | None = None,
    ) -> "Frames":
        """Frames of many scenes as one flat list, for training or evaluation.

        Args:
            split: Only scenes of this split; None: all splits.
            keys: Only frames that have all of these keys.
            maps: Only scenes on these maps; None: all maps.
            every: Only every Nth of a scene's remaining frames.
            agent: Only scenes with this agent, as it sees them; None: all scenes, as the first agent sees each.

        Raises:
            InputError: The split is unknown, or no scene has this map, agent or key.
            BagError: A scene that must be opened to look for agents or keys cannot be read.
        """
        if split is not None and split not in SPLITS:
            raise InputError(f"split: {split!r} is none of {', '.join(SPLITS)}")
        known = {scene.map for scene in self.scenes} if maps is not None else set()
        unknown = sorted(set(maps or ()) - known)
        if unknown:
            raise InputError(f"maps: {', '.join(unknown)}: {self.path} has scenes of {', '.join(sorted(known))}")
        chosen = [s for s in self.scenes if split in (None, s.split) and (maps is None or s.map in maps)]
        if agent is not None:
            chosen = _scenes_of_agent(chosen, agent)
        for key in keys if chosen else ():
            if not any(key in scene.sources for scene in chosen):
                raise InputError(f"keys: no scene has {key!r}; {chosen[0].name} has {', '.join(chosen[0].keys)}")
        ticks = [np.flatnonzero(s.has(keys)) if keys else np.arange(len(s)) for s in chosen]
        return Frames(chosen, [each[::every] for each in ticks])

    def __repr__(self) -> str:
        return f"<dataset {self.path}, {len(self.scenes)} scenes>"


class Frames(Sequence[Frame]):
    """A flat list of frames of several scenes; each frame is created on access."""

    def __init__(self, scenes: Sequence[Scene], ticks: Sequence[Any]) -> None:
        """Create the list.

        Args:
            scenes: Scenes.
            ticks: For each scene an int64 array with the ticks of its frames.
        """
        self._scenes = tuple(scenes)
        self._scene = np.repeat(np.arange(len(scenes)), [len(each) for each in ticks])
        self._tick = np.concatenate([np.zeros(0, np.int64), *ticks])

    def __len__(self) -> int:
        return len(self._tick)

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [self[number] for number in range(len(self))[index]]
        return self._scenes[int(self._scene[index])][int(self._tick[index])]


def _scenes_of_agent(scenes: Sequence[Scene], agent: str) -> list[Scene]:
    """The scenes that have an agent, as it sees them. Raises InputError if none of them has."""
    found = [scene.of_agent(agent) for scene in scenes if agent in scene.agents]
    if scenes and not found:
        names = sorted({name for scene in scenes for name in scene.agents})
        raise InputError(f"agent: no scene has {agent!r}, but {', '.join(names)}")
    return found


def open_dataset(path: AnyPath | str, *, cache_bytes: int = CACHE_BYTES, threads: int | None = None) -> Dataset:
    """Open a dataset, or one bag, even if the bag is unfinished or truncated.

    Args:
        path: A dataset's folder, a bag's folder, or an MCAP file; also as a URL, ``s3://bucket/prefix``. A dataset is
            opened with all its finished scenes, in an object store with all that are in its index; reading a scene
            that was truncated afterwards raises BagError.
        cache_bytes: Size of the cache of decompressed chunks, in each process.
        threads: Number of threads that decode in ``Frame.load``; None: one for each core.

    Raises:
        InputError: The dataset's index is damaged, or the object store cannot be reached or refuses access.
        BagError: There is no dataset and no bag at this path, or the bag cannot be read.
    """
    path, cache = path_or_url(path), ChunkCache(cache_bytes)
    if not is_dataset(path):
        locate_mcap(path)
        return Dataset(path, [Scene(path, cache, threads=threads, may_be_cut_off=True)])
    if isinstance(path, ObjectPath):
        indexed = sorted(indexed_bags(path).items(), key=lambda item: (item[1]["number"], item[0]))
        return Dataset(path, [Scene(bag, cache, None, row, threads) for bag, row in indexed])
    rows = {row["path"]: row for row in read_index(path)}
    bags = sorted(finished_scenes(path).items(), key=lambda item: (int(item[0].name.rpartition("-")[2]), item[0]))
    return Dataset(
        path, [Scene(bag, cache, additional, _current_row(rows, path, bag), threads) for bag, additional in bags]
    )


def _current_row(rows: Mapping[str, Mapping[str, Any]], dataset: Path, bag: Path) -> Mapping[str, Any] | None:
    """The index's row of a bag, unless the bag's size has changed since it was written."""
    row = rows.get(str(bag.relative_to(dataset)))
    return row if row is not None and row["bytes"] == bytes_of(bag) else None
