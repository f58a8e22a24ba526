"""Timing the recorder: its writer, and its whole node behind DDS, against a bare loop of the mcap package."""

import os
import shutil
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import NamedTuple

from mcap.writer import Writer
from rich.console import Console
from rosbags.typesys import Stores, get_typestore

from simbev_ros.bench.record_load import Images, Message, recorded_scene, recorded_tick
from simbev_ros.bench.recorder_timing import timed_recorder
from simbev_ros.config.scenario import Recording
from simbev_ros.recording.bag_files import check_space
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.qos import QosProfile
from simbev_ros.scene.spec import SceneSpec

_TYPES = get_typestore(Stores.ROS2_JAZZY)
_IMAGES: tuple[Images, ...] = ("raw", "compressed")
_BARE, _WRITER, _RECORDER = "mcap package", "writer", "recorder node"


class _Spent(NamedTuple):
    wall_s: float
    cpu_s: float
    file_bytes: int


class _Load(NamedTuple):
    """What is recorded: a scene, and what each of its ticks holds."""

    spec: SceneSpec
    images: Images
    tick: Mapping[str, Message]


_Work = Callable[[Path, _Load], tuple[float, float]]
"""Writes into a folder; gives wall and processor time, s."""


@dataclass(frozen=True, slots=True)
class RecordTiming:
    """How fast some topics were recorded, one way.

    Attributes:
        topics: Which: raw or compressed images.
        way: By the mcap package's writer, by ours, or by the recorder's node, to which they come through DDS.
        mb_per_s: Payload over wall time: the median, and the best.
        cpu_s_per_gb: Processor time of all threads, the least.
        size: Of the file over the payload.
        ratio: Speed over that of the mcap package: the median of rounds.
    """

    topics: str
    way: str
    mb_per_s: float
    best_mb_per_s: float
    cpu_s_per_gb: float
    size: float
    ratio: float


@dataclass(frozen=True, slots=True)
class RecordTimings:
    """All of them.

    Attributes:
        tick_mb: Payload of a tick, by kind of topics.
    """

    ticks: int
    rounds: int
    tick_mb: dict[str, float]
    timings: list[RecordTiming]

    def rows(self) -> list[tuple[str, ...]]:
        """Of a table: topics, way, speeds, processor time, size, ratio."""
        return [
            (
                f"{each.topics}, {self.tick_mb[each.topics]:.0f} MB/tick",
                each.way,
                f"{each.mb_per_s:.0f}",
                f"{each.best_mb_per_s:.0f}",
                f"{each.cpu_s_per_gb:.2f}",
                f"{each.size:.2f}",
                f"{each.ratio:.2f}",
            )
            for each in self.timings
        ]


def timed_recording(
    folder: Path, ticks: int, rounds: int, console: Console, progress: Callable[[], None] = lambda: None
) -> RecordTimings:
    """Record so many ticks each way, again and again in turn.

    Args:
        folder: On the disk that is to be written to; nothing stays there.
        ticks: In each file.
        rounds: How often.
        console: Shows how the map is loaded.
        progress: Called after each file.

    Raises:
        DiskError: There is not enough room.
        SimbevError: The recorder's process fails.
    """
    spec, timings = recorded_scene(ticks, console), []
    tick_mb: dict[str, float] = {}
    for images in _IMAGES:
        load = _Load(spec, images, recorded_tick(spec, images))
        tick_mb[images] = sum(len(message.data) for message in load.tick.values()) / 1e6
        check_space(folder, int(2e6 * tick_mb[images] * ticks))
        spent: dict[str, list[_Spent]] = {way: [] for way in _WAYS}
        for _ in range(rounds):
            for way, work in _WAYS.items():
                spent[way].append(_spent(folder, work, load))
                progress()
        timings += [_timing(images, way, spent[way], spent[_BARE], tick_mb[images] * ticks) for way in _WAYS]
    return RecordTimings(ticks, rounds, tick_mb, timings)


def _spent(folder: Path, work: _Work, load: _Load) -> _Spent:
    """What some writing into a folder, which is removed afterwards, takes."""
    place = Path(tempfile.mkdtemp(prefix="simbev_ros-bench-", dir=folder))
    try:
        wall_s, cpu_s = work(place, load)
        return _Spent(wall_s, cpu_s, sum(file.stat().st_size for file in place.rglob("*.mcap")))
    finally:
        shutil.rmtree(place)


def _timing(images: str, way: str, spent: Sequence[_Spent], bare: Sequence[_Spent], payload_mb: float) -> RecordTiming:
    speeds = [payload_mb / each.wall_s for each in spent]
    return RecordTiming(
        topics=images,
        way=way,
        mb_per_s=median(speeds),
        best_mb_per_s=max(speeds),
        cpu_s_per_gb=min(each.cpu_s for each in spent) / payload_mb * 1e3,
        size=spent[0].file_bytes / payload_mb / 1e6,
        ratio=median(theirs.wall_s / ours.wall_s for theirs, ours in zip(bare, spent, strict=True)),
    )


def files_to_write(rounds: int) -> int:
    """How often progress is reported."""
    return len(_IMAGES) * rounds * len(_WAYS)


def _write_bare(place: Path, load: _Load) -> tuple[float, float]:
    """Chunks as large as ours, and on the disk at the end like ours."""
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    with (place / "bare.mcap").open("wb") as stream:
        writer = Writer(stream, chunk_size=Recording().chunk_kib << 10)
        writer.start("ros2")
        channels = {}
        for topic, (type_name, _) in load.tick.items():
            definition, _ = _TYPES.generate_msgdef(type_name, ros_version=2)
            schema = writer.register_schema(type_name, "ros2msg", definition.encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        for number in range(load.spec.ticks):
            stamp_ns = load.spec.stamp_ns(number)
            for topic, (_, data) in load.tick.items():
                writer.add_message(channels[topic], stamp_ns, data, stamp_ns, number)
        writer.finish()  # type: ignore[no-untyped-call]
        stream.flush()
        os.fsync(stream.fileno())
    return time.perf_counter() - wall_s, time.process_time() - cpu_s


def _write_ours(place: Path, load: _Load) -> tuple[float, float]:
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    with SceneBagWriter(place / "ours") as writer:
        for topic, (type_name, _) in load.tick.items():
            writer.add_topic(topic, type_name, QosProfile())
        for number in range(load.spec.ticks):
            for topic, (_, data) in load.tick.items():
                writer.write(topic, load.spec.stamp_ns(number), data)
        writer.finish({})
    return time.perf_counter() - wall_s, time.process_time() - cpu_s


def _record(place: Path, load: _Load) -> tuple[float, float]:
    """The time of whoever sends is not the recorder's, but both share the cores."""
    messages = {topic: message.data for topic, message in load.tick.items()}
    timing = timed_recorder(load.spec, Recording(images=load.images), messages, place)
    return timing.wall_s, timing.cpu_s


_WAYS: Mapping[str, _Work] = {_BARE: _write_bare, _WRITER: _write_ours, _RECORDER: _record}
