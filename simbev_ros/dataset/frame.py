"""A frame: all sensor data and labels of one tick of a scene, decoded on first access."""

import os
from collections.abc import Collection, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import cached_property, lru_cache
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import numpy as np

from simbev_ros.dataset.content import Source
from simbev_ros.dataset.messages import newest_messages
from simbev_ros.dataset.values import poses_from_odometry
from simbev_ros.foundation.threads import usable_cores
from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.schema.boxes import LIGHT_IDS
from simbev_ros.schema.trajectories import HORIZON_S, Futures, futures

if TYPE_CHECKING:
    from simbev_ros.dataset.scene import Scene

_MESSAGES = "v2x"
"""Key of what arrives at an agent at a tick."""


class Frame(Mapping[str, Any]):
    """Mapping from keys to an agent's sensor data and labels of one tick; each is decoded on first access and kept.

    A sensor or label that is slower than the tick rate has no key in most frames; ``last`` gives its latest sample. A
    sensor with several samples per tick, such as a fast IMU, has all samples since the previous tick.

    Attributes:
        scene: The scene that the frame belongs to.
        tick: Index of the frame in the scene.
        stamp_ns: Simulated time, ns.
    """

    def __init__(self, scene: "Scene", tick: int) -> None:
        self.scene, self.tick = scene, tick
        self.stamp_ns = int(scene.stamps_ns[tick])
        self._values: dict[str, Any] = {}

    def __getitem__(self, key: str) -> Any:
        if key not in self._values:
            self._values[key] = self._source(key).value(self._existing_locations(key))
        return self._values[key]

    def __iter__(self) -> Iterator[str]:
        return (key for key in self.scene.sources if len(self._locations(key)))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, key: object) -> bool:
        return key in self.scene.sources and len(self._locations(str(key))) > 0

    def __eq__(self, other: object) -> bool:
        return self is other

    __hash__ = object.__hash__

    def __repr__(self) -> str:
        return f"<frame {self.tick} of scene {self.scene.name}>"

    def load(self, keys: Collection[str] | None = None) -> dict[str, Any]:
        """Decode several keys at once in parallel threads; ``Scene.threads`` is their number.

        Args:
            keys: The keys to decode; None: all keys of the frame.

        Returns:
            Values by key.

        Raises:
            KeyError: The frame lacks one of the keys.
            BagError: The bag is damaged.
        """
        wanted = list(self) if keys is None else list(keys)
        if self.scene.threads == 1:
            return {key: self[key] for key in wanted}
        pool, chunks = _decoders(os.getpid(), self.scene.threads or usable_cores()), self._keys_by_chunk(wanted)
        values: dict[str, Future[Any]] = {}
        for group, following in zip_longest(chunks, chunks[1:]):
            if following:  # decompress the next chunk while messages of this one are decoded
                pool.submit(self._source(following[0]).bag.payload, self._existing_locations(following[0])[0])
            values.update({key: pool.submit(self.__getitem__, key) for key in group})
        return {key: values[key].result() for key in wanted}

    def last(self, key: str) -> Any:
        """Latest value of a key, from this tick or an earlier one.

        Raises:
            KeyError: The scene has no such key, or it has no value yet.
        """
        tick = self.last_tick(key)
        if tick is None:
            raise KeyError(f"{key!r} has no value up to tick {self.tick} of scene {self.scene.name}")
        return self[key] if tick == self.tick else Frame(self.scene, tick)[key]

    def last_tick(self, key: str, max_age_ns: int | None = None) -> int | None:
        """Tick of the latest value of a key, from this tick or an earlier one; None if there is none, or an older one.

        Args:
            key: The key.
            max_age_ns: Maximum age of the value; None: any.

        Raises:
            KeyError: The scene has no such key.
        """
        after_ns = -1 if max_age_ns is None else self.stamp_ns - max_age_ns - 1
        locations = self._source(key).topic.between(after_ns, self.stamp_ns)
        return int(np.searchsorted(self.scene.stamps_ns, locations[-1, 0])) if len(locations) else None

    def messages(self, key: str) -> list[Any]:
        """Messages of a key with all fields of their ROS types: headers, covariances, JPEG, PNG and H.264 as recorded.

        Their arrays are views of the file's decompressed chunk, which stays in memory as long as they do.

        Raises:
            KeyError: The scene has no such key.
        """
        return self._source(key).messages(self._locations(key))

    @cached_property
    def others(self) -> Mapping[str, "Frame"]:
        """Frames of the same tick that the scene's other agents see, by name of the agent."""
        scenes = {name: self.scene.of_agent(name) for name in self.scene.agents if name != self.scene.agent}
        return {name: Frame(scene, self.tick) for name, scene in scenes.items()}

    @cached_property
    def received(self) -> Mapping[str, "Frame"]:
        """Frames of other agents at the newest messages that have arrived, by the sender's name, in the scene's order.

        Each is the sender's frame of the tick at which it sent its newest message that has arrived: its sensor data and
        labels are thus as old as the message, and an agent out of range is missing. Messages count that have arrived
        within the last second, or the last period of sending if that is longer.

        Raises:
            KeyError: The scene has no messages for this agent.
            BagError: The bag is damaged.
        """
        scene = self.scene
        if _MESSAGES not in scene.sources or scene.spec.v2x is None:
            raise KeyError(f"scene {scene.name} has no messages to {scene.agent}")
        ticks = newest_messages(scene.spec, scene.agent, self.tick, lambda tick: Frame(scene, tick).get(_MESSAGES))
        return {name: Frame(scene.of_agent(name), tick) for name, tick in ticks.items()}

    @property
    def map_from_ego(self) -> Float64Array:
        """(4, 4) pose of the agent: x forward, y left, z up, origin on the ground below the center of its box.

        That of a roadside unit is the pose of its mast's foot.
        """
        return poses_from_odometry(self["odom"][-1])

    def map_from_sensor(self, name: str) -> Float64Array:
        """(4, 4) pose of a sensor's frame, x forward, y left, z up: the frame of point clouds and of camera bodies."""
        return self.map_from_ego @ self.scene.calibration[name].ego_from_sensor

    def map_from_optical(self, name: str) -> Float64Array:
        """(4, 4) pose of a camera's optical frame: x right, y down, z forward."""
        return self.map_from_ego @ self.scene.calibration[name].ego_from_optical

    def futures(self, horizon_s: float = HORIZON_S, step_s: float | None = None) -> Futures:
        """Future trajectory of each of the N rows of ``boxes``; never valid for lights and signs, which do not move.

        Args:
            horizon_s: Length of the trajectories.
            step_s: Time between positions; None: one tick.

        Raises:
            BagError: The bag holds no trajectories because it was not finished.
            InputError: The step is not a whole number of ticks, or it is longer than the horizon.
        """
        ids = self["boxes"]["id"]
        moving = np.flatnonzero(ids < LIGHT_IDS)
        known = futures(self.scene.tracks, ids[moving], np.full(len(moving), self.stamp_ns), horizon_s, step_s)
        return replace(
            known,
            valid=_scatter(known.valid, moving, len(ids)),
            position_m=_scatter(known.position_m, moving, len(ids)),
            yaw_rad=_scatter(known.yaw_rad, moving, len(ids)),
            velocity_mps=_scatter(known.velocity_mps, moving, len(ids)),
        )

    def _keys_by_chunk(self, keys: Collection[str]) -> list[list[str]]:
        """Keys grouped by the chunk that their first message is in, in the order of the file."""
        chunks: dict[tuple[str | int, ...], list[str]] = {}
        for key in keys:
            _, *chunk, _ = self._existing_locations(key)[0].tolist()
            chunks.setdefault((str(self._source(key).bag.file), *chunk), []).append(key)
        return [chunks[chunk] for chunk in sorted(chunks)]

    def _existing_locations(self, key: str) -> Int64Array:
        """(K, 4) locations of a key's messages; raises KeyError if there are none."""
        locations = self._locations(key)
        if not len(locations):
            raise KeyError(f"{key!r} has no value at tick {self.tick} of scene {self.scene.name}; see Frame.last")
        return locations

    def _locations(self, key: str) -> Int64Array:
        after_ns = self.stamp_ns - self.scene.tick_ns if self.tick else -1
        return self._source(key).topic.between(after_ns, self.stamp_ns)

    def _source(self, key: str) -> Source:
        try:
            return self.scene.sources[key]
        except KeyError:
            has = ", ".join(self.scene.sources)
            raise KeyError(f"scene {self.scene.name} has no {key!r}, but {has}") from None


def _scatter(rows: Any, indices: Int64Array, count: int) -> Any:
    """(count, …) array with the rows at the given indices and zeros elsewhere."""
    result = np.zeros((count, *rows.shape[1:]), rows.dtype)
    result[indices] = rows
    return result


@lru_cache(maxsize=4)
def _decoders(process: int, threads: int) -> ThreadPoolExecutor:
    """Threads of one process that decode; a forked process inherits its parent's pools without their threads."""
    return ThreadPoolExecutor(threads, thread_name_prefix=f"decoder-{process}")
