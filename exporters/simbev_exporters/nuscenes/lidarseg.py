"""Exports the labels of a scene's lidar points as nuScenes-lidarseg has them: one byte a point, for each sample.

A scene enters; a part of the export leaves, next to the part with the scene's files, so that labels are added to an
export, or removed, without making its scenes again. Labels are of the uppermost lidar, as in nuScenes, and need its
semantic cloud.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from glob import escape
from pathlib import Path

from simbev_exporters.nuscenes.point_categories import labels_of_points, labels_of_surfaces
from simbev_exporters.nuscenes.scene_part import ScenePart
from simbev_exporters.nuscenes.taxonomy import Record, sample_data_token, scene_token
from simbev_exporters.scene_parts import PartOfScene, source_of
from simbev_ros.config.lidar import Lidar
from simbev_ros.dataset import Frame, Scene
from simbev_ros.dataset.nuscenes.channels import TOP_LIDAR, Channel, channels_of
from simbev_ros.dataset.nuscenes.keyframes import keyframe_by_tick, keyframes_of
from simbev_ros.export.parts import PARTS_FOLDER, Part
from simbev_ros.foundation.types import UInt8Array

FOLDER = "lidarseg"
"""Folder of the labels, with one folder for each version of the tables."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LidarsegPart(PartOfScene):
    """The labels of a scene as one part of the export. Its record contains the rows of the table ``lidarseg``.

    Attributes:
        keyframe_hz: Number of keyframes per second; None: every frame is one.
        version: Name of the tables' folder.
    """

    keyframe_hz: float | None
    version: str

    def rows(self) -> list[Record]:
        """The rows of the table ``lidarseg`` of the finished part."""
        rows: list[Record] = self.finished_record()["rows"]
        return rows


def lidarseg_parts(parts: Sequence[ScenePart], version: str) -> list[LidarsegPart]:
    """The parts with the labels of scenes that can have labels, finished or not."""
    return [
        LidarsegPart(
            out=part.out,
            name=f"{part.name}.{version}.lidarseg",
            identity={"made_from": {**source_of(part.scene), "keyframe_hz": part.keyframe_hz}},
            patterns=(),  # names of labels do not contain their scene; remove_other_labels removes those left over
            scene=part.scene,
            keyframe_hz=part.keyframe_hz,
            version=version,
        )
        for part in parts
        if not why_without_labels(part.scene)
    ]


def remove_other_labels(out: Path, version: str, parts: Sequence[LidarsegPart]) -> None:
    """Remove the labels of all other parts, as the devkit refuses a folder with files that are not in the table.

    Args:
        out: Folder of the export.
        version: Name of the tables' folder.
        parts: The finished parts with labels in the table; none: it has no labels.
    """
    kept, suffix = {part.name for part in parts}, f".{version}.lidarseg"
    for record in (out / PARTS_FOLDER).glob(f"*{escape(suffix)}.json"):
        name = record.name.removesuffix(".json")
        if name not in kept:
            Part(out=out, name=name, identity={}, patterns=()).remove()
    named = {row["filename"] for part in parts for row in part.rows()}
    for file in (out / FOLDER / version).glob("*"):
        if str(file.relative_to(out)) not in named:
            file.unlink()


def why_without_labels(scene: Scene) -> str:
    """The reason why a scene cannot have labels; "" if it can."""
    channel = _top_lidar(scene)
    if channel is None:
        return "it has no lidar, without which the devkit cannot evaluate detections either"
    key = semantic_key(channel)
    return "" if key in scene.sources else f"{key} was not recorded"


def make_lidarseg_part(part: LidarsegPart) -> None:
    """Make the labels of one scene.

    Raises:
        InputError: The scene cannot have keyframes at that rate, or a file cannot be written.
        BagError: The bag is damaged or lacks data that the labels need.
    """
    scene, channel = part.scene, _top_lidar(part.scene)
    part.begin()
    rows: list[Record] = []
    if channel is not None:
        ticks = keyframe_by_tick(scene, channel, keyframes_of(scene, part.keyframe_hz))
        for tick in sorted(ticks):
            frame = scene[tick]
            if semantic_key(channel) in frame:
                token = sample_data_token(scene_token(scene), channel.name, tick)
                file = f"{FOLDER}/{part.version}/{token}_lidarseg.bin"
                part.write(file, frame_labels(frame, channel).tobytes())
                rows.append({"token": token, "sample_data_token": token, "filename": file})
    part.finish({"rows": rows})


def frame_labels(frame: Frame, channel: Channel) -> UInt8Array:
    """(N,) labels of the points of a lidar's file at a frame, in their order."""
    semantic_cloud = frame[semantic_key(channel)]
    blueprints = frame.scene.constants["world/legend"]["blueprints"]
    labels = labels_of_surfaces(semantic_cloud, frame["world/actors"], blueprints, frame.scene.view.ego_id)
    if channel.key == semantic_key(channel):
        return labels
    lidar = channel.calibration.sensor
    assert isinstance(lidar, Lidar)
    return labels_of_points(frame[channel.key], semantic_cloud, labels, lidar.range_noise_sigma_m)


def _top_lidar(scene: Scene) -> Channel | None:
    return next((channel for channel in channels_of(scene) if channel.name == TOP_LIDAR), None)


def semantic_key(channel: Channel) -> str:
    """Key of the semantic cloud of a lidar."""
    return f"{channel.calibration.sensor.name}/semantic_points"
