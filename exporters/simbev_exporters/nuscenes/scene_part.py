"""Exports one scene to nuScenes' layout: writes the files of its samples and sweeps, and its rows of the tables.

A scene enters; one part of the export (``export.parts``) leaves, from which ``tables`` later builds the tables of all
scenes. Positions in a part are in the map frame; in the final tables they are relative to the corner of the map's mask.
"""

import json
from dataclasses import dataclass
from glob import escape
from pathlib import Path

from simbev_exporters.nuscenes.annotations import Annotations
from simbev_exporters.nuscenes.scene_tables import SceneTables
from simbev_exporters.nuscenes.taxonomy import Record
from simbev_exporters.scene_parts import PartOfScene, source_of
from simbev_ros.dataset import Dataset
from simbev_ros.dataset.nuscenes.channels import NO_NAMES, ChannelNames, channels_of
from simbev_ros.dataset.nuscenes.keyframes import keyframes_of, swept_ticks
from simbev_ros.dataset.parallel import report_step
from simbev_ros.export.parts import PARTS_FOLDER, Json
from simbev_ros.foundation.files.structured_text import parse_json


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenePart(PartOfScene):
    """A scene as one part of the export. Its record contains the item ``summary``, facts that the tables need early.

    Attributes:
        keyframe_hz: Number of keyframes per second; None: every frame is one.
        sweeps: Whether to write sensor data between keyframes.
        keep_unhit: Whether boxes without lidar and radar points are annotated.
        channels: Channels of sensors with other names than by default, ``channels_of``.
    """

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
    scene, annotations = part.scene, Annotations(part.scene, keep_unhit=part.keep_unhit)
    ticks, channels = keyframes_of(scene, part.keyframe_hz), channels_of(scene, part.channels)
    tables = SceneTables(scene, ticks, channels, annotations, part.write, sweeps=part.sweeps)
    part.begin()
    for tick in swept_ticks(scene).tolist():
        tables.add(scene[tick])
        report_step()
    part.write(part.rows_file, json.dumps(tables.tables()).encode())
    part.finish({"summary": tables.summary()})
