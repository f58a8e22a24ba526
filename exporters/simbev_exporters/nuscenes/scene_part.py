"""Exports one scene to nuScenes' layout: writes the files of its samples and sweeps, and its rows of the tables.

A scene enters; one part of the export (``export.parts``) leaves, from which ``tables`` later builds the tables of all
scenes. Positions in a part are in the map frame; in the final tables they are relative to the corner of the map's mask.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from glob import escape
from pathlib import Path
from typing import Any

import numpy as np

from simbev_exporters.nuscenes.annotations import Annotations, link, make_continuous
from simbev_exporters.nuscenes.channel_records import calibration_record, data_file, image_size_px, sensor_record, wxyz
from simbev_exporters.nuscenes.sensor_files import encode_file
from simbev_exporters.nuscenes.taxonomy import Record, sample_data_token, scene_token, token
from simbev_ros.dataset import Dataset, Frame, Scene
from simbev_ros.dataset.nuscenes.channels import NO_NAMES, Channel, ChannelNames, channels_of
from simbev_ros.dataset.nuscenes.keyframes import keyframe_by_tick, keyframes_of, swept_ticks
from simbev_ros.dataset.parallel import report_step
from simbev_ros.export.part_making import source_of
from simbev_ros.export.parts import PARTS_FOLDER, Json, Part
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.types import Int64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.weather import Weather

_RAIN_PERCENT = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenePart(Part):
    """A scene as one part of the export. Its record contains the item ``summary``, facts that the tables need early.

    Attributes:
        scene: The scene.
        keyframe_hz: Number of keyframes per second; None: every frame is one.
        sweeps: Whether to write sensor data between keyframes.
        keep_unhit: Whether boxes without lidar and radar points are annotated.
        channels: Channels of sensors with other names than by default, ``channels_of``.
    """

    scene: Scene
    keyframe_hz: float | None
    sweeps: bool
    keep_unhit: bool
    channels: ChannelNames

    @property
    def rows_file(self) -> str:
        """Path of the file with the scene's rows of the tables, relative to ``out``."""
        return f"{PARTS_FOLDER}/{self.name}.json"

    def summary(self) -> Json:
        """Facts about the scene of the finished part."""
        return self.finished_record()["summary"]

    def rows(self) -> dict[str, list[Record]]:
        """The rows of the tables of the finished part, by name of the table."""
        return parse_json((self.out / self.rows_file).read_bytes())


def parts_of(
    dataset: Dataset,
    out: Path,
    *,
    keyframe_hz: float | None,
    sweeps: bool,
    keep_unhit: bool = False,
    channels: ChannelNames = NO_NAMES,
) -> list[ScenePart]:
    """The parts of all finished scenes of a dataset, finished or not; the settings are attributes of the parts.

    Raises:
        BagError: A bag cannot be read.
    """
    named = {sensor: list(names) for sensor, names in sorted(channels.items())}
    settings = {"keyframe_hz": keyframe_hz, "sweeps": sweeps, "keep_unhit": keep_unhit, "channels": named}
    return [
        ScenePart(
            out=out,
            name=scene.name,
            identity={"made_from": {**source_of(scene), **settings}},
            patterns=(f"*/*/{escape(scene.name)}__*",),
            record_suffix=".head.json",
            scene=scene,
            keyframe_hz=keyframe_hz,
            sweeps=sweeps,
            keep_unhit=keep_unhit,
            channels=channels,
        )
        for scene in dataset.scenes
    ]


def make_part(part: ScenePart) -> None:
    """Make the part of one scene: its files and its rows of the tables; each frame is a step of parallel work.

    Raises:
        InputError: The scene cannot have keyframes at that rate, and an earlier part of the scene is kept; or a file
            cannot be written.
        BagError: The bag is damaged or lacks data that the tables need.
    """
    job = _Job(part, keyframes_of(part.scene, part.keyframe_hz))
    part.begin()
    for tick in swept_ticks(part.scene).tolist():
        job.add(part.scene[tick])
        report_step()
    part.write(part.rows_file, json.dumps(job.tables()).encode())
    part.finish({"summary": job.summary()})


class _Job:
    """The export of one scene, frame by frame: writes files and collects the rows of the tables."""

    def __init__(self, part: ScenePart, ticks: Int64Array) -> None:
        self._part, self._scene, self._ticks = part, part.scene, ticks
        self._token = scene_token(self._scene)
        self._channels = channels_of(self._scene, part.channels)
        self._is_key = {channel.name: keyframe_by_tick(self._scene, channel, ticks) for channel in self._channels}
        self._data: dict[str, list[Record]] = {channel.name: [] for channel in self._channels}
        self._poses: list[Record] = []
        self._annotations = Annotations(self._scene, self._token, keep_unhit=part.keep_unhit)

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
            "calibrated_sensor": [calibration_record(channel, self._token) for channel in self._channels],
            **self._annotations.tables(),
        }

    def _is_wanted(self, channel: Channel, frame: Frame) -> bool:
        return self._part.sweeps or frame.tick in self._is_key[channel.name]

    def _write(self, channel: Channel, frame: Frame) -> Record:
        """Write the file of a channel at a frame, and return its row of the table ``sample_data``."""
        keyframe = self._is_key[channel.name].get(frame.tick)
        name = data_file(channel, self._scene.name, _stamp_us(frame))
        file = Path("sweeps" if keyframe is None else "samples", channel.name, name)
        self._part.write(file.as_posix(), encode_file(frame, channel))
        width_px, height_px = image_size_px(channel)
        return {
            "token": sample_data_token(self._token, channel.name, frame.tick),
            "sample_token": self._sample_token(self._keyframe_of_sweep(frame.tick) if keyframe is None else keyframe),
            "ego_pose_token": token("ego_pose", self._token, frame.tick),
            "calibrated_sensor_token": token("calibrated_sensor", self._token, channel.name),
            "timestamp": _stamp_us(frame),
            "fileformat": "jpg" if channel.modality == "camera" else "pcd",
            "is_key_frame": keyframe is not None,
            "height": height_px,
            "width": width_px,
            "filename": file.as_posix(),
        }

    def _keyframe_of_sweep(self, tick: int) -> int:
        """Tick of the keyframe that a sweep belongs to: the next one, or the last one at the end of the scene."""
        return int(self._ticks[min(int(np.searchsorted(self._ticks, tick)), len(self._ticks) - 1)])

    def _pose(self, frame: Frame) -> Record:
        row = frame["odom"][-1]
        return {
            "token": token("ego_pose", self._token, frame.tick),
            "timestamp": _stamp_us(frame),
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


def _stamp_us(frame: Frame) -> int:
    return frame.stamp_ns // 1000


def _description(scene: Scene) -> str:
    """Description of a scene in nuScenes' words, by which code finds scenes at night and in rain."""
    return ", ".join([scene.spec.map.name, *_weather_words(scene.weather)])


def _weather_words(weather: Weather) -> list[str]:
    words = ["night" if weather.sun_altitude_deg < 0 else "day"]
    if weather.precipitation >= _RAIN_PERCENT:
        words.append("rain")
    return words
