"""Timing the recorder: its writer, and all that it does with messages, against a bare loop of the mcap package."""

import os
import shutil
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore

from simbev_ros.config.scenario import Recording
from simbev_ros.recording.bag_files import check_space
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.canonical import canonical
from simbev_ros.recording.qos import QosProfile

_TYPES = get_typestore(Stores.ROS2_JAZZY)
_TICK_NS = 50_000_000
_CAMERAS = 6
_WIDTH_PX, _HEIGHT_PX = 1600, 900
_ENCODED_BYTES = {"rgb": 330_000, "semantic": 45_000, "instance": 60_000, "depth": 800_000, "flow": 1_500_000}
"""Of 1600x900 pixels, as JPEG and PNG."""
_LIDAR_RAYS = 128 * 2048

_BARE, _WRITER, _RECORDER = "mcap package", "writer", "recorder"


class _Message(NamedTuple):
    topic: str
    type_name: str
    data: bytes


_Work = Callable[[Path, Sequence[_Message], int], None]


class _Spent(NamedTuple):
    wall_s: float
    cpu_s: float
    file_bytes: int


@dataclass(frozen=True, slots=True)
class RecordTiming:
    """How fast some topics were recorded, one way.

    Attributes:
        topics: Which: raw or compressed images.
        way: By the mcap package's writer, by ours, or by ours with all that the recorder does with a message before.
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
    folder: Path, ticks: int, rounds: int, progress: Callable[[], None] = lambda: None
) -> RecordTimings:
    """Record so many ticks each way, again and again in turn.

    Args:
        folder: On the disk that is to be written to; nothing stays there.
        ticks: In each file.
        rounds: How often.
        progress: Called after each file.

    Raises:
        DiskError: There is not enough room.
    """
    timings, tick_mb = [], {}
    for kind, tick in (("raw", _raw_tick()), ("compressed", _compressed_tick())):
        tick_mb[kind] = sum(len(message.data) for message in tick) / 1e6
        check_space(folder, int(2e6 * tick_mb[kind] * ticks))
        spent: dict[str, list[_Spent]] = {way: [] for way in _WAYS}
        for _ in range(rounds):
            for way, work in _WAYS.items():
                spent[way].append(_spent(folder, work, tick, ticks))
                progress()
        timings += [_timing(kind, way, spent[way], spent[_BARE], tick_mb[kind] * ticks) for way in _WAYS]
    return RecordTimings(ticks, rounds, tick_mb, timings)


def _spent(folder: Path, work: _Work, tick: Sequence[_Message], ticks: int) -> _Spent:
    """What some writing into a folder, which is removed afterwards, takes."""
    place = Path(tempfile.mkdtemp(prefix="simbev_ros-bench-", dir=folder))
    try:
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        work(place, tick, ticks)
        wall_s, cpu_s = time.perf_counter() - wall_s, time.process_time() - cpu_s
        return _Spent(wall_s, cpu_s, sum(file.stat().st_size for file in place.rglob("*.mcap")))
    finally:
        shutil.rmtree(place)


def _timing(kind: str, way: str, spent: Sequence[_Spent], bare: Sequence[_Spent], payload_mb: float) -> RecordTiming:
    speeds = [payload_mb / each.wall_s for each in spent]
    return RecordTiming(
        topics=kind,
        way=way,
        mb_per_s=median(speeds),
        best_mb_per_s=max(speeds),
        cpu_s_per_gb=min(each.cpu_s for each in spent) / payload_mb * 1e3,
        size=spent[0].file_bytes / payload_mb / 1e6,
        ratio=median(theirs.wall_s / ours.wall_s for theirs, ours in zip(bare, spent, strict=True)),
    )


def files_to_write(rounds: int) -> int:
    """How often progress is reported."""
    return 2 * rounds * len(_WAYS)


def _write_bare(place: Path, tick: Sequence[_Message], ticks: int) -> None:
    """Chunks as large as ours, and on the disk at the end like ours."""
    with (place / "bare.mcap").open("wb") as stream:
        writer = Writer(stream, chunk_size=Recording().chunk_kib << 10)
        writer.start("ros2")
        channels = {}
        for topic, type_name, _ in tick:
            definition, _ = _TYPES.generate_msgdef(type_name, ros_version=2)
            schema = writer.register_schema(type_name, "ros2msg", definition.encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        for number in range(ticks):
            for topic, _, data in tick:
                writer.add_message(channels[topic], number * _TICK_NS, data, number * _TICK_NS, number)
        writer.finish()  # type: ignore[no-untyped-call]
        stream.flush()
        os.fsync(stream.fileno())


def _write_ours(place: Path, tick: Sequence[_Message], ticks: int, *, as_recorder: bool = False) -> None:
    recording = Recording()
    with SceneBagWriter(place / "ours", chunk_bytes=recording.chunk_kib << 10) as writer:
        for topic, type_name, _ in tick:
            writer.add_topic(topic, type_name, QosProfile())
        for number in range(ticks):
            for topic, type_name, data in tick:
                writer.write(topic, number * _TICK_NS, canonical(data, type_name) if as_recorder else data)
        writer.finish({})


def _record(place: Path, tick: Sequence[_Message], ticks: int) -> None:
    _write_ours(place, tick, ticks, as_recorder=True)


_WAYS: Mapping[str, _Work] = {_BARE: _write_bare, _WRITER: _write_ours, _RECORDER: _record}


def _raw_tick() -> list[_Message]:
    """Colour images of six cameras, smooth with noise, and small messages."""
    rng = np.random.default_rng(0)
    row, column = np.mgrid[:_HEIGHT_PX, :_WIDTH_PX]
    messages = []
    for camera in range(_CAMERAS):
        smooth = 128 + 90 * np.sin(row / (150 + 9 * camera)) * np.cos(column / 210)
        image = smooth[..., None] + rng.integers(-2, 3, (_HEIGHT_PX, _WIDTH_PX, 3))
        data = image.astype(np.uint8).ravel()
        fields = {"height": _HEIGHT_PX, "width": _WIDTH_PX, "encoding": "rgb8", "step": 3 * _WIDTH_PX, "data": data}
        messages.append(_message(f"/ego/cam_{camera}/rgb/image_raw", "sensor_msgs/msg/Image", is_bigendian=0, **fields))
    return [*messages, *_small_messages()]


def _compressed_tick() -> list[_Message]:
    """Five modalities of six cameras as JPEG and PNG, which look random to zstd, and a cloud."""
    rng = np.random.default_rng(0)
    messages = []
    for camera in range(_CAMERAS):
        for modality, size in _ENCODED_BYTES.items():
            topic, data = f"/ego/cam_{camera}/{modality}/image_raw/compressed", rng.integers(0, 256, size, np.uint8)
            messages.append(_message(topic, "sensor_msgs/msg/CompressedImage", format="png", data=data))
    return [*messages, _cloud(rng), *_small_messages()]


def _cloud(rng: np.random.Generator) -> _Message:
    """A lidar's turn: x y z intensity float32, ring uint16, time float32."""
    azimuth = np.linspace(0, 2 * np.pi, _LIDAR_RAYS)
    range_m = 30 + 10 * np.sin(9 * azimuth) + rng.normal(0, 0.02, _LIDAR_RAYS)
    table = np.zeros(_LIDAR_RAYS, [("xyzi", "<f4", 4), ("ring", "<u2"), ("time", "<f4")])
    table["xyzi"] = np.stack([range_m * np.cos(azimuth), range_m * np.sin(azimuth), range_m / 9, 1 / range_m], axis=1)
    table["ring"], table["time"] = np.arange(_LIDAR_RAYS) % 128, azimuth
    data, step = np.frombuffer(table.tobytes(), np.uint8), table.itemsize
    fields = {"height": 1, "width": len(table), "fields": [], "point_step": step, "row_step": len(data), "data": data}
    return _message("/ego/lidar/points", "sensor_msgs/msg/PointCloud2", is_bigendian=False, is_dense=True, **fields)


def _small_messages() -> list[_Message]:
    """Many that take their time for their number alone."""
    text = _TYPES.types["std_msgs/msg/String"]('{"stamp_ns": 0}')
    data = bytes(_TYPES.serialize_cdr(text, "std_msgs/msg/String"))
    return [_Message(f"/small/{number}", "std_msgs/msg/String", data) for number in range(30)]


def _message(topic: str, type_name: str, **fields: Any) -> _Message:
    types = _TYPES.types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), topic)
    message = types[type_name](header=header, **fields)
    return _Message(topic, type_name, bytes(_TYPES.serialize_cdr(message, type_name)))
