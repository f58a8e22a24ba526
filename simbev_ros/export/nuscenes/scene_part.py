"""One scene in nuScenes' layout: the files of its samples and sweeps, and its rows of the tables.

Positions are in the map frame here; the tables of the whole have them from the corner of the map's mask on.
"""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from simbev_ros.dataset import Frame, Scene
from simbev_ros.dataset.parallel import step
from simbev_ros.export.nuscenes.annotations import Annotations, link
from simbev_ros.export.nuscenes.channels import Channel, channels_of, wxyz
from simbev_ros.export.nuscenes.keyframes import keyframes_of, taken_by, whole_ticks
from simbev_ros.export.nuscenes.parts import Parts
from simbev_ros.export.nuscenes.sensor_files import file_content
from simbev_ros.export.nuscenes.taxonomy import Record, token
from simbev_ros.scene.weather import Weather
from simbev_ros.types import Int64Array
from simbev_ros.units import NS_PER_S

_RAIN_PERCENT = 10.0


def make_part(scene: Scene, parts: Parts) -> None:
    """Write a scene's files, and put down its rows of the tables; each frame is a ``step`` of parallel work.

    Args:
        scene: The scene.
        parts: Where to. Settings: ``keyframe_hz``, None for all frames, and ``sweeps``, whether to have what is between
            keyframes.

    Raises:
        InputError: The scene has no such keyframes; an earlier part of it stays.
        BagError: The bag is damaged, or lacks what the tables need.
    """
    ticks, keyframes = whole_ticks(scene), keyframes_of(scene, parts.settings["keyframe_hz"])
    job = _Job(scene, parts.begin(scene), keyframes, sweeps=parts.settings["sweeps"])
    for tick in ticks.tolist():
        job.add(scene[tick])
        step()
    parts.move_in(scene, job.summary(), job.tables())


class _Job:
    """A scene on its way."""

    def __init__(self, scene: Scene, folder: Path, ticks: Int64Array, *, sweeps: bool) -> None:
        self._scene, self._folder, self._ticks, self._sweeps = scene, folder, ticks, sweeps
        self._token = token("scene", scene.name, scene.spec.seed)
        self._channels = channels_of(scene)
        self._is_key = {channel.name: taken_by(scene, channel, ticks) for channel in self._channels}
        self._data: dict[str, list[Record]] = {channel.name: [] for channel in self._channels}
        self._poses: list[Record] = []
        self._annotations = Annotations(scene, self._token)
        for channel in self._channels:
            for part in ("samples", "sweeps") if sweeps else ("samples",):
                (folder / part / channel.name).mkdir(parents=True)

    def add(self, frame: Frame) -> None:
        """The next frame."""
        if frame.tick in self._ticks:
            self._annotations.add(self._sample_token(frame.tick), frame)
        written = [channel for channel in self._channels if channel.key in frame and self._is_wanted(channel, frame)]
        if written:
            self._poses.append(self._pose(frame))
        for channel in written:
            self._data[channel.name].append(self._write(channel, frame))

    def summary(self) -> dict[str, Any]:
        """What is to be known of all scenes before the tables are written."""
        places = np.array([pose["translation"][:2] for pose in self._poses]).reshape(-1, 2)
        return {
            "name": self._scene.name,
            "split": self._scene.split,
            "map": self._scene.spec.map.model_dump(mode="json"),
            "low_m": places.min(axis=0).tolist(),
            "high_m": places.max(axis=0).tolist(),
            "samples": len(self._ticks),
            "files": sum(map(len, self._data.values())),
            "sensors": [channel.sensor_record() for channel in self._channels],
        }

    def tables(self) -> dict[str, list[Record]]:
        """The rows of the tables that tell of scenes."""
        for chain in self._data.values():
            link(chain)
        samples = [self._sample(tick) for tick in self._ticks.tolist()]
        link(samples)
        log = token("log", self._token)
        return {
            "scene": [self._record(samples, log)],
            "log": [self._log(log)],
            "sample": samples,
            "sample_data": [record for chain in self._data.values() for record in chain],
            "ego_pose": self._poses,
            "calibrated_sensor": [channel.calibration_record(self._token) for channel in self._channels],
            **self._annotations.tables(),
        }

    def _is_wanted(self, channel: Channel, frame: Frame) -> bool:
        return self._sweeps or frame.tick in self._is_key[channel.name]

    def _write(self, channel: Channel, frame: Frame) -> Record:
        """Write a file; give its row of the table ``sample_data``."""
        keyframe = self._is_key[channel.name].get(frame.tick)
        name = channel.file(self._scene.name, _microseconds(frame))
        file = Path("sweeps" if keyframe is None else "samples", channel.name, name)
        (self._folder / file).write_bytes(file_content(frame, channel))
        width_px, height_px = channel.size_px
        return {
            "token": token("sample_data", self._token, channel.name, frame.tick),
            "sample_token": self._sample_token(self._following(frame.tick) if keyframe is None else keyframe),
            "ego_pose_token": token("ego_pose", self._token, frame.tick),
            "calibrated_sensor_token": token("calibrated_sensor", self._token, channel.name),
            "timestamp": _microseconds(frame),
            "fileformat": "jpg" if channel.modality == "camera" else "pcd",
            "is_key_frame": keyframe is not None,
            "height": height_px,
            "width": width_px,
            "filename": file.as_posix(),
        }

    def _following(self, tick: int) -> int:
        """The keyframe that a sweep belongs to: the next one, or the last."""
        return int(self._ticks[min(int(np.searchsorted(self._ticks, tick)), len(self._ticks) - 1)])

    def _pose(self, frame: Frame) -> Record:
        row = frame["odom"][-1]
        return {
            "token": token("ego_pose", self._token, frame.tick),
            "timestamp": _microseconds(frame),
            "rotation": wxyz(row["orientation_xyzw"]).tolist(),
            "translation": row["position_m"].tolist(),
        }

    def _sample(self, tick: int) -> Record:
        stamp_us = int(self._scene.stamps_ns[tick]) // 1000
        return {"token": self._sample_token(tick), "timestamp": stamp_us, "scene_token": self._token}

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

    def _log(self, log: str) -> Record:
        day = datetime.fromtimestamp(self._scene.spec.start_ns // NS_PER_S, UTC).date()
        return {"token": log, "logfile": self._scene.name, "vehicle": "simbev", "date_captured": day.isoformat()}

    def _sample_token(self, tick: int) -> str:
        return token("sample", self._token, tick)


def _microseconds(frame: Frame) -> int:
    return frame.stamp_ns // 1000


def _description(scene: Scene) -> str:
    """Words as in nuScenes' own, by which code finds scenes at night and in rain."""
    return ", ".join([scene.spec.map.name, *_weather_words(scene.weather)])


def _weather_words(weather: Weather) -> list[str]:
    words = ["night" if weather.sun_altitude_deg < 0 else "day"]
    if weather.precipitation >= _RAIN_PERCENT:
        words.append("rain")
    return words
