"""The rows of one scene's tables in nuScenes' form, and the files of its sensors, frame by frame.

Frames enter; rows by name of their table leave, and contents of files go to a function. Positions are in the map frame.
``t4`` changes what differs in TIER IV's format.
"""

from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, ClassVar

import numpy as np

from simbev_exporters.nuscenes.annotations import Annotations, link, make_continuous
from simbev_exporters.nuscenes.channel_records import calibration_record, data_file, image_size_px, sensor_record, wxyz
from simbev_exporters.nuscenes.sensor_files import encode_file
from simbev_exporters.nuscenes.taxonomy import Record, sample_data_token, scene_token, token
from simbev_ros.dataset import Frame, Scene
from simbev_ros.dataset.nuscenes.channels import Channel, Modality
from simbev_ros.dataset.nuscenes.keyframes import keyframe_by_tick
from simbev_ros.foundation.types import Int64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.weather import Weather

_RAIN_PERCENT = 10.0


class SceneTables:
    """The tables of one scene, collected frame by frame while the files of its sensors are written.

    Args:
        scene: The scene.
        ticks: (K,) ticks of the keyframes.
        channels: The exported sensors.
        annotations: Collector of the scene's annotations.
        write: Receives the path of each file, relative to the export, and its content.
        sweeps: Whether to write sensor data between keyframes.
    """

    file_formats: ClassVar[Mapping[Modality, str]] = {"camera": "jpg", "lidar": "pcd", "radar": "pcd"}
    """``fileformat`` of each modality in the table ``sample_data``."""

    def __init__(
        self,
        scene: Scene,
        ticks: Int64Array,
        channels: Sequence[Channel],
        annotations: Annotations,
        write: Callable[[str, bytes], None],
        *,
        sweeps: bool,
    ) -> None:
        self._scene, self._ticks, self._channels, self._sweeps = scene, ticks, channels, sweeps
        self._annotations, self._write_file = annotations, write
        self._token = scene_token(scene)
        self._is_key = {channel.name: keyframe_by_tick(scene, channel, ticks) for channel in channels}
        self._data: dict[str, list[Record]] = {channel.name: [] for channel in channels}
        self._poses: list[Record] = []

    def add(self, frame: Frame) -> None:
        """Write the files of the next frame and collect its rows."""
        if frame.tick in self._ticks:
            self._annotations.add(self._sample_token(frame.tick), frame)
        written = [channel for channel in self._channels if channel.key in frame and self._is_wanted(channel, frame)]
        if written:
            self._poses.append(self._pose(frame))
        for channel in written:
            self._data[channel.name].append(self._write(channel, frame))

    def summary(self) -> dict[str, Any]:
        """The facts that must be known of all scenes before the tables are written; plain values."""
        positions_m = np.array([pose["translation"][:2] for pose in self._poses]).reshape(-1, 2)
        return {
            "name": self._scene.name,
            "split": self._scene.split,
            "map": self._scene.spec.map.model_dump(mode="json"),
            "low_m": positions_m.min(axis=0).tolist(),
            "high_m": positions_m.max(axis=0).tolist(),
            "samples": len(self._ticks),
            "files": sum(map(len, self._data.values())),
            "sensors": [sensor_record(channel) for channel in self._channels],
        }

    def tables(self) -> dict[str, list[Record]]:
        """The scene's rows of the tables, by name of the table."""
        for chain in self._data.values():
            link(chain)
        make_continuous(self._poses, "rotation")
        samples = [self._sample(tick) for tick in self._ticks.tolist()]
        link(samples)
        log = token("log", self._token)
        return {
            "scene": [self._record(samples, log)],
            "log": [self._log(log)],
            "sample": samples,
            "sample_data": [record for chain in self._data.values() for record in chain],
            "ego_pose": self._poses,
            "calibrated_sensor": [self._calibration(channel) for channel in self._channels],
            **self._annotations.tables(),
        }

    def _file(self, channel: Channel, frame: Frame, keyframe: int | None) -> str:
        """Path of the file of a channel at a frame that belongs to the tick of a keyframe, or of a sweep."""
        name = data_file(channel, self._scene.name, stamp_us(frame))
        return f"{'sweeps' if keyframe is None else 'samples'}/{channel.name}/{name}"

    def _content(self, channel: Channel, frame: Frame) -> bytes:
        """Content of the file of a channel at a frame."""
        return encode_file(frame, channel)

    def _pose(self, frame: Frame) -> Record:
        """Row of the table ``ego_pose``."""
        row = frame["odom"][-1]
        return {
            "token": token("ego_pose", self._token, frame.tick),
            "timestamp": stamp_us(frame),
            "rotation": wxyz(row["orientation_xyzw"]).tolist(),
            "translation": row["position_m"].tolist(),
        }

    def _calibration(self, channel: Channel) -> Record:
        """Row of the table ``calibrated_sensor``."""
        return calibration_record(channel, self._token, channel.ego_from_channel)

    def _log(self, log: str) -> Record:
        """Row of the table ``log`` with a token."""
        day = captured_at(self._scene).date()
        return {"token": log, "logfile": self._scene.name, "vehicle": "simbev", "date_captured": day.isoformat()}

    def _is_wanted(self, channel: Channel, frame: Frame) -> bool:
        return self._sweeps or frame.tick in self._is_key[channel.name]

    def _write(self, channel: Channel, frame: Frame) -> Record:
        """Write the file of a channel at a frame, and return its row of the table ``sample_data``."""
        keyframe = self._is_key[channel.name].get(frame.tick)
        file = self._file(channel, frame, keyframe)
        self._write_file(file, self._content(channel, frame))
        width_px, height_px = image_size_px(channel)
        return {
            "token": sample_data_token(self._token, channel.name, frame.tick),
            "sample_token": self._sample_token(self._keyframe_of_sweep(frame.tick) if keyframe is None else keyframe),
            "ego_pose_token": token("ego_pose", self._token, frame.tick),
            "calibrated_sensor_token": token("calibrated_sensor", self._token, channel.name),
            "timestamp": stamp_us(frame),
            "fileformat": self.file_formats[channel.modality],
            "is_key_frame": keyframe is not None,
            "height": height_px,
            "width": width_px,
            "filename": file,
        }

    def _keyframe_of_sweep(self, tick: int) -> int:
        """Tick of the keyframe that a sweep belongs to: the next one, or the last one at the end of the scene."""
        return int(self._ticks[min(int(np.searchsorted(self._ticks, tick)), len(self._ticks) - 1)])

    def _sample(self, tick: int) -> Record:
        time_us = int(self._scene.stamps_ns[tick]) // 1000
        return {"token": self._sample_token(tick), "timestamp": time_us, "scene_token": self._token}

    def _record(self, samples: Sequence[Record], log: str) -> Record:
        return {
            "token": self._token,
            "log_token": log,
            "nbr_samples": len(samples),
            "first_sample_token": samples[0]["token"],
            "last_sample_token": samples[-1]["token"],
            "name": self._scene.name,
            "description": _description(self._scene),
        }

    def _sample_token(self, tick: int) -> str:
        return token("sample", self._token, tick)


def stamp_us(frame: Frame) -> int:
    """Timestamp of a frame."""
    return frame.stamp_ns // 1000


def captured_at(scene: Scene) -> datetime:
    """Simulated time of day at which a scene starts."""
    return datetime.fromtimestamp(scene.spec.start_ns // NS_PER_S, UTC)


def _description(scene: Scene) -> str:
    """Description of a scene in nuScenes' words, by which code finds scenes at night and in rain."""
    return ", ".join([scene.spec.map.name, *_weather_words(scene.weather)])


def _weather_words(weather: Weather) -> list[str]:
    words = ["night" if weather.sun_altitude_deg < 0 else "day"]
    if weather.precipitation >= _RAIN_PERCENT:
        words.append("rain")
    return words
