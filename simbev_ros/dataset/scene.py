"""Scenes and their frames: all that was sensed and labelled at each tick, decoded when it is asked for."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, overload

import numpy as np

from simbev_ros.annotation.boxes import LIGHT_IDS
from simbev_ros.annotation.trajectories import HORIZON_S, Futures, Tracks, futures
from simbev_ros.dataset.calibration import Calibration
from simbev_ros.dataset.content import Content, Source, tracks_of
from simbev_ros.dataset.decoders import decoders
from simbev_ros.geometry.transforms import matrices_from_xyz_quaternion
from simbev_ros.recording.chunk_cache import ChunkCache
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.weather import Weather
from simbev_ros.types import Float64Array, Int64Array, Table


class Scene(Sequence["Frame"]):
    """One scene: a sequence of frames, one a tick. It is read when something of it is asked for.

    Attributes:
        path: Its bag.
        additional: Additional bags of the same motion, by label.
        row: What the dataset's index says of it; empty if it has no row there.
        threads: How many decode at a time; None: one for each core.
    """

    def __init__(
        self,
        path: Path,
        cache: ChunkCache,
        additional: Mapping[str, Path] | None = None,
        row: Mapping[str, Any] | None = None,
        threads: int | None = None,
    ) -> None:
        self.path, self.additional, self.row, self.threads = path, dict(additional or {}), dict(row or {}), threads
        self._cache = cache

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

    @property
    def spec(self) -> SceneSpec:
        """All that was drawn for it."""
        return self._content.spec

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
        """Of all that frames can have, in order of name."""
        return tuple(sorted(self._content.sources))

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

    def source(self, key: str) -> Source:
        """The topic behind a key, its type and its messages.

        Raises:
            KeyError: The scene has no such key.
        """
        try:
            return self._content.sources[key]
        except KeyError:
            raise KeyError(f"scene {self.name} has no {key!r}; it has {', '.join(self.keys)}") from None

    def has(self, keys: Collection[str]) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """(T,) whether each frame has all of some keys."""
        edges_ns = np.append(self.stamps_ns[:1] - self.spec.tick_ns, self.stamps_ns)
        found = np.ones(len(self), np.bool_)
        for key in keys:
            known = self._content.sources.get(key)
            stamps_ns = np.zeros(0, np.int64) if known is None else known.topic.stamps_ns
            found &= np.diff(np.searchsorted(stamps_ns, edges_ns, side="right")) > 0
        return found

    def __len__(self) -> int:
        return int(self.row["recorded_ticks"]) if self.row else len(self.stamps_ns)

    @overload
    def __getitem__(self, index: int) -> "Frame": ...
    @overload
    def __getitem__(self, index: slice) -> "list[Frame]": ...
    def __getitem__(self, index: int | slice) -> "Frame | list[Frame]":
        if isinstance(index, slice):
            return [Frame(self, tick) for tick in range(len(self))[index]]
        return Frame(self, range(len(self))[index])

    def __repr__(self) -> str:
        return f"<scene {self.name}, {len(self)} frames>"

    @cached_property
    def _content(self) -> Content:
        return Content.of(self.path, self.additional, self._cache)


class Frame(Mapping[str, Any]):
    """All of one tick, by key; what a key's topic holds is decoded when it is first asked for, and kept.

    A sensor with a lower rate than the ticks' has no key in most frames; ``last`` gives its latest sample. What has
    several samples a tick, as a fast IMU, has all since the tick before.

    Attributes:
        scene: The scene that it belongs to.
        tick: Its place there.
        stamp_ns: Simulated time, ns.
    """

    def __init__(self, scene: Scene, tick: int) -> None:
        self.scene, self.tick = scene, tick
        self.stamp_ns = int(scene.stamps_ns[tick])
        self._values: dict[str, Any] = {}

    def __getitem__(self, key: str) -> Any:
        if key not in self._values:
            places = self._places(key)
            if not len(places):
                raise KeyError(f"{key!r} has nothing at tick {self.tick} of scene {self.scene.name}; see Frame.last")
            self._values[key] = self.scene.source(key).value(places)
        return self._values[key]

    def __iter__(self) -> Iterator[str]:
        return (key for key in self.scene.keys if len(self._places(key)))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, key: object) -> bool:
        return key in self.scene.keys and len(self._places(str(key))) > 0

    def __repr__(self) -> str:
        return f"<frame {self.tick} of scene {self.scene.name}>"

    def load(self, keys: Collection[str] | None = None) -> dict[str, Any]:
        """Decode several keys at once, in threads.

        Args:
            keys: Which; None: all of the frame.

        Raises:
            KeyError: The frame has not all of them.
            BagError: The bag is damaged.
        """
        wanted = list(self) if keys is None else list(keys)
        return dict(zip(wanted, decoders(self.scene.threads).map(self.__getitem__, wanted), strict=True))

    def last(self, key: str) -> Any:
        """What a key's topic has said last, at this tick or before.

        Raises:
            KeyError: The scene has no such key, or nothing was said yet.
        """
        places = self.scene.source(key).topic.between(-1, self.stamp_ns)
        if not len(places):
            raise KeyError(f"{key!r} has nothing up to tick {self.tick} of scene {self.scene.name}")
        tick = self.scene.spec.publishing_tick_of(int(places[-1, 0]))
        return self[key] if tick == self.tick else Frame(self.scene, tick)[key]

    def messages(self, key: str) -> list[Any]:
        """The messages themselves, with the fields of their ROS types: headers, covariances, JPEG and PNG as recorded.

        Raises:
            KeyError: The scene has no such key.
        """
        return self.scene.source(key).messages(self._places(key))

    @property
    def map_from_ego(self) -> Float64Array:
        """(4, 4) pose of the ego: x forward, y left, z up, origin on the ground below the box's centre."""
        row = self["odom"][-1]
        return matrices_from_xyz_quaternion(row["position_m"], row["orientation_xyzw"])

    def map_from_sensor(self, name: str) -> Float64Array:
        """(4, 4) pose of a sensor's frame, x forward, y left, z up; that of clouds, and a camera's body."""
        return self.map_from_ego @ self.scene.calibration[name].ego_from_sensor

    def map_from_optical(self, name: str) -> Float64Array:
        """(4, 4) pose of a camera's optical frame: x right, y down, z forward."""
        return self.map_from_ego @ self.scene.calibration[name].ego_from_optical

    def futures(self, horizon_s: float = HORIZON_S, step_s: float | None = None) -> Futures:
        """Where each of the N rows of ``boxes`` goes; never valid for lights and signs, which stand.

        Args:
            horizon_s: How far to look ahead.
            step_s: Time between places; None: a tick.

        Raises:
            BagError: The bag holds no trajectories, as it was not finished.
            InputError: The step is no whole number of ticks, or the horizon is shorter.
        """
        ids = self["boxes"]["id"]
        moving = np.flatnonzero(ids < LIGHT_IDS)
        known = futures(self.scene.tracks, ids[moving], np.full(len(moving), self.stamp_ns), horizon_s, step_s)
        return replace(
            known,
            valid=_spread(known.valid, moving, len(ids)),
            position_m=_spread(known.position_m, moving, len(ids)),
            yaw_rad=_spread(known.yaw_rad, moving, len(ids)),
            velocity_mps=_spread(known.velocity_mps, moving, len(ids)),
        )

    def _places(self, key: str) -> Int64Array:
        after_ns = self.stamp_ns - self.scene.spec.tick_ns if self.tick else -1
        return self.scene.source(key).topic.between(after_ns, self.stamp_ns)


def _spread(rows: Any, places: Int64Array, count: int) -> Any:
    """(count, …) rows at their places, zero elsewhere."""
    result = np.zeros((count, *rows.shape[1:]), rows.dtype)
    result[places] = rows
    return result


def columns(table: Table, *names: str) -> np.ndarray[Any, Any]:
    """(N, K) array of K columns of (N,) rows, as ``columns(frame["lidar/points"], "x", "y", "z")``."""
    return np.stack([table[name] for name in names], axis=1)
