"""Times the recorder, its writer alone and its node behind DDS, against a bare loop of the mcap package."""

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
from rosbags.typesys import Stores, get_typestore

from simbev_ros.config.scenario import Recording
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.recording.bag_files import check_space
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.qos import QosProfile
from simbev_ros.schema.scene.spec import SceneSpec
from tools.bench.record_load import Images, Message, recorded_scene, recorded_tick
from tools.bench.recorder_timing import timed_recorder

_TYPES = get_typestore(Stores.ROS2_JAZZY)
_IMAGES: tuple[Images, ...] = ("raw", "compressed")
_BARE, _WRITER, _RECORDER = "mcap package", "writer", "recorder node"


class _Spent(NamedTuple):
    wall_s: float
    cpu_s: float
    file_bytes: int


class _Load(NamedTuple):
    """The input to record: a scene, and the messages of each tick."""

    spec: SceneSpec
    images: Images
    tick: Mapping[str, Message]


_Work = Callable[[Path, _Load], tuple[float, float]]
"""Writes into a folder and returns wall time and processor time, s."""


@dataclass(frozen=True, slots=True)
class RecordTiming:
    """Speed of one writer.

    Attributes:
        topics: Kind of images: raw or compressed.
        way: The writer: that of the mcap package, ours, or the recorder node, which receives messages through DDS.
        mb_per_s: Payload per wall time, the median of all rounds.
        best_mb_per_s: Payload per wall time of the fastest round.
        cpu_s_per_gb: Processor time of all threads per payload, the minimum.
        size: Size of the file relative to the payload.
        ratio: Speed relative to the mcap package, the median of all rounds.
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
    """Speeds of all writers.

    Attributes:
        ticks: Number of ticks in each file.
        rounds: Number of files that each writer wrote.
        tick_mb: Payload of a tick, by kind of images.
        timings: Each writer with each kind of images.
    """

    ticks: int
    rounds: int
    tick_mb: dict[str, float]
    timings: list[RecordTiming]

    def rows(self) -> list[tuple[str, ...]]:
        """Rows of a table: topics, writer, speeds, processor time, size, ratio."""
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
    folder: Path,
    ticks: int,
    rounds: int,
    progress: Callable[[], None] = lambda: None,
    observer: ProductionObserver = SILENT,
) -> RecordTimings:
    """Record the same messages with each writer, in turn and repeatedly.

    Args:
        folder: A folder on the disk to write to; all files are removed again.
        ticks: Number of ticks in each file.
        rounds: Number of files that each writer writes.
        progress: Called after each file.
        observer: Receives the progress of loading the map.

    Raises:
        DiskError: There is not enough space.
        SimbevError: The recorder's process fails.
    """
    spec, timings = recorded_scene(ticks, observer), []
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
    """Time and file size of writing into a temporary folder."""
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
    """Number of files, after each of which progress is reported."""
    return len(_IMAGES) * rounds * len(_WAYS)


def _write_bare(place: Path, load: _Load) -> tuple[float, float]:
    """Write with the mcap package, with our chunk size, and sync to the disk at the end as we do."""
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
        writer.finish()
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
    """Record through DDS; the sender's time is not counted, but it shares the cores with the recorder."""
    messages = {topic: message.data for topic, message in load.tick.items()}
    timing = timed_recorder(load.spec, Recording(images=load.images), messages, place)
    return timing.wall_s, timing.cpu_s


_WAYS: Mapping[str, _Work] = {_BARE: _write_bare, _WRITER: _write_ours, _RECORDER: _record}
