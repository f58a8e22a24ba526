"""Scenes and their frames: all that was sensed and labelled at each tick, decoded when it is asked for."""

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import Any, overload

import numpy as np

from simbev_ros.annotation.trajectories import Tracks
from simbev_ros.dataset.calibration import Calibration
from simbev_ros.dataset.content import Content, Source, spec_of, tracks_of
from simbev_ros.dataset.frame import Frame
from simbev_ros.recording.mcap.chunk_cache import ChunkCache
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.weather import Weather
from simbev_ros.types import BoolArray, Int64Array


class Scene(Sequence[Frame]):
    """One scene: a sequence of frames, one a tick. It is read when something of it is asked for.

    Attributes:
        path: Its bag.
        additional: Additional bags of the same motion, by label.
        row: What the dataset's index says of it; empty if it has no row there.
        threads: How many decode at a time in ``Frame.load``; None: one for each core.
        may_be_cut_off: Whether what is left of a bag that was cut off counts as the scene; else it raises BagError.
    """

    def __init__(
        self,
        path: Path,
        cache: ChunkCache,
        additional: Mapping[str, Path] | None = None,
        row: Mapping[str, Any] | None = None,
        threads: int | None = None,
        *,
        may_be_cut_off: bool = False,
    ) -> None:
        self.path, self.additional, self.row, self.threads = path, dict(additional or {}), dict(row or {}), threads
        self.may_be_cut_off, self._cache = may_be_cut_off, cache

    @property
    def name(self) -> str:
        """``<map>-<number>``."""
        return str(self.row["name"]) if self.row else self.spec.name

    @property
    def number(self) -> int:
        """Its number in the dataset."""
        return int(self.row["number"]) if self.row else self.spec.number

    @property
    def split(self) -> str:
        """``train``, ``val`` or ``test``."""
        return str(self.row["split"]) if self.row else self.spec.split

    @property
    def map(self) -> str:
        """Name of its map."""
        return str(self.row["map"]) if self.row else self.spec.map.name

    @cached_property
    def spec(self) -> SceneSpec:
        """All that was drawn for it."""
        return spec_of(self._content.bag)

    @property
    def weather(self) -> Weather:
        """At the first tick; ``spec.weather_at`` knows the others."""
        return self.spec.weather

    @property
    def stamps_ns(self) -> Int64Array:
        """(T,) stamps of the frames, ns."""
        return self._content.stamps_ns

    @property
    def keys(self) -> tuple[str, ...]:
        """Of all that frames can have, in order of name; slower sensors are not in every frame."""
        return tuple(self.sources)

    @property
    def tick_ns(self) -> int:
        """From one frame to the next."""
        return self._content.tick_ns

    @property
    def sources(self) -> Mapping[str, Source]:
        """The topics that frames can have something of, by key, in order of key."""
        return self._content.sources

    @property
    def calibration(self) -> Mapping[str, Calibration]:
        """By name of sensor."""
        return self._content.calibration

    @cached_property
    def constants(self) -> Mapping[str, Any]:
        """What is said once for the whole scene, by key, as ``world/map`` (OpenDRIVE) and ``world/legend``."""
        return {key: s.value(s.topic.places) for key, s in self._content.constants.items() if len(s.topic.places)}

    @cached_property
    def tracks(self) -> Tracks:
        """Where every actor goes.

        Raises:
            BagError: The bag holds none, as it was not finished.
        """
        return tracks_of(self.path)

    def has(self, keys: Collection[str]) -> BoolArray:
        """(T,) whether each frame has all of some keys."""
        edges_ns = np.append(self.stamps_ns[:1] - self.tick_ns, self.stamps_ns)
        found = np.ones(len(self), np.bool_)
        for key in keys:
            known = self.sources.get(key)
            stamps_ns = np.zeros(0, np.int64) if known is None else known.stamps_ns
            found &= np.diff(np.searchsorted(stamps_ns, edges_ns, side="right")) > 0
        return found

    def __len__(self) -> int:
        return int(self.row["recorded_ticks"]) if self.row else len(self.stamps_ns)

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [Frame(self, tick) for tick in range(len(self))[index]]
        return Frame(self, range(len(self))[index])

    def __reduce__(self) -> tuple[Any, ...]:
        """As it was before anything was read, so that it is small when it is sent to another process."""
        made = partial(Scene, may_be_cut_off=self.may_be_cut_off)
        return made, (self.path, self._cache, self.additional, self.row, self.threads)

    def __repr__(self) -> str:
        return f"<scene {self.name}, {len(self)} frames>"

    @cached_property
    def _content(self) -> Content:
        return Content.of(self.path, self.additional, self._cache, may_be_cut_off=self.may_be_cut_off)
