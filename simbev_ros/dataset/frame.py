"""One tick of a scene: all that was sensed and labelled then, decoded when it is asked for."""

from collections.abc import Collection, Iterator, Mapping
from concurrent.futures import Future
from dataclasses import replace
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import numpy as np

from simbev_ros.annotation.boxes.boxes import LIGHT_IDS
from simbev_ros.annotation.trajectories import HORIZON_S, Futures, futures
from simbev_ros.dataset.content import Source
from simbev_ros.dataset.decoders import decoders
from simbev_ros.dataset.values import poses_from_odometry
from simbev_ros.types import Float64Array, Int64Array

if TYPE_CHECKING:
    from simbev_ros.dataset.scene import Scene


class Frame(Mapping[str, Any]):
    """All of one tick, by key; what a key's topic holds is decoded when it is first asked for, and kept.

    A sensor with a lower rate than the ticks' has no key in most frames; ``last`` gives its latest sample. What has
    several samples a tick, as a fast IMU, has all since the tick before.

    Attributes:
        scene: The scene that it belongs to.
        tick: Its place there.
        stamp_ns: Simulated time, ns.
    """

    def __init__(self, scene: "Scene", tick: int) -> None:
        self.scene, self.tick = scene, tick
        self.stamp_ns = int(scene.stamps_ns[tick])
        self._values: dict[str, Any] = {}

    def __getitem__(self, key: str) -> Any:
        if key not in self._values:
            self._values[key] = self._source(key).value(self._found(key))
        return self._values[key]

    def __iter__(self) -> Iterator[str]:
        return (key for key in self.scene.sources if len(self._places(key)))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, key: object) -> bool:
        return key in self.scene.sources and len(self._places(str(key))) > 0

    def __eq__(self, other: object) -> bool:
        return self is other

    __hash__ = object.__hash__

    def __repr__(self) -> str:
        return f"<frame {self.tick} of scene {self.scene.name}>"

    def load(self, keys: Collection[str] | None = None) -> dict[str, Any]:
        """Decode several keys at once, in threads, as many as the scene says.

        Args:
            keys: Which; None: all of the frame.

        Raises:
            KeyError: The frame has not all of them.
            BagError: The bag is damaged.
        """
        wanted = list(self) if keys is None else list(keys)
        if self.scene.threads == 1:
            return {key: self[key] for key in wanted}
        pool, chunks = decoders(self.scene.threads), self._chunks(wanted)
        values: dict[str, Future[Any]] = {}
        for group, following in zip_longest(chunks, chunks[1:]):
            if following:  # while what is in a chunk is decoded, the next one is decompressed
                pool.submit(self._source(following[0]).bag.payload, self._found(following[0])[0])
            values.update({key: pool.submit(self.__getitem__, key) for key in group})
        return {key: values[key].result() for key in wanted}

    def last(self, key: str) -> Any:
        """What a key's topic has said last, at this tick or before.

        Raises:
            KeyError: The scene has no such key, or nothing was said yet.
        """
        places = self._source(key).topic.between(-1, self.stamp_ns)
        if not len(places):
            raise KeyError(f"{key!r} has nothing up to tick {self.tick} of scene {self.scene.name}")
        tick = int(np.searchsorted(self.scene.stamps_ns, places[-1, 0]))
        return self[key] if tick == self.tick else Frame(self.scene, tick)[key]

    def messages(self, key: str) -> list[Any]:
        """The messages themselves, with the fields of their ROS types: headers, covariances, JPEG and PNG as recorded.

        Their arrays are views of the file's decompressed chunk, which stays in memory as long as they do.

        Raises:
            KeyError: The scene has no such key.
        """
        return self._source(key).messages(self._places(key))

    @property
    def map_from_ego(self) -> Float64Array:
        """(4, 4) pose of the ego: x forward, y left, z up, origin on the ground below the box's centre."""
        return poses_from_odometry(self["odom"][-1])

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

    def _chunks(self, keys: Collection[str]) -> list[list[str]]:
        """Keys by the chunk that they begin in, in the order of the file."""
        chunks: dict[tuple[str | int, ...], list[str]] = {}
        for key in keys:
            _, *chunk, _ = self._found(key)[0].tolist()
            chunks.setdefault((str(self._source(key).bag.file), *chunk), []).append(key)
        return [chunks[chunk] for chunk in sorted(chunks)]

    def _found(self, key: str) -> Int64Array:
        """(K, …) places of a key's messages, of which there must be some."""
        places = self._places(key)
        if not len(places):
            raise KeyError(f"{key!r} has nothing at tick {self.tick} of scene {self.scene.name}; see Frame.last")
        return places

    def _places(self, key: str) -> Int64Array:
        after_ns = self.stamp_ns - self.scene.tick_ns if self.tick else -1
        return self._source(key).topic.between(after_ns, self.stamp_ns)

    def _source(self, key: str) -> Source:
        try:
            return self.scene.sources[key]
        except KeyError:
            has = ", ".join(self.scene.sources)
            raise KeyError(f"scene {self.scene.name} has no {key!r}, but {has}") from None


def _spread(rows: Any, places: Int64Array, count: int) -> Any:
    """(count, …) rows at their places, zero elsewhere."""
    result = np.zeros((count, *rows.shape[1:]), rows.dtype)
    result[places] = rows
    return result
