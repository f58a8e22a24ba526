"""Exports a dataset to nuScenes' layout: scenes in parallel, then masks of maps and the tables.

The entry point of ``simbev export nuscenes``: an opened dataset enters; a folder that the devkit can open leaves.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np

from simbev_exporters.nuscenes.can_bus import CanBusPart, can_bus_parts, imu_of, make_can_bus_part
from simbev_exporters.nuscenes.lidarseg import (
    LidarsegPart,
    lidarseg_parts,
    make_lidarseg_part,
    remove_other_labels,
    why_without_labels,
)
from simbev_exporters.nuscenes.scene_names import SceneNames, published_names
from simbev_exporters.nuscenes.scene_part import ScenePart, make_part, parts_of
from simbev_exporters.nuscenes.sites import Site, sites_of
from simbev_exporters.nuscenes.tables import write_tables
from simbev_exporters.scene_parts import Failures, Report, frame_count, ignore_progress, make_parts, unfinished, without
from simbev_ros.dataset import Dataset
from simbev_ros.dataset.nuscenes.channels import ChannelNames, require_named_sensors
from simbev_ros.dataset.parallel import OWN_PROCESS, Pool
from simbev_ros.export.parts import PARTS_FOLDER, hold_export, is_begun
from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_ros.foundation.files.whole_files import write_errors, write_whole
from simbev_ros.foundation.installation.extras import load_extras
from simbev_ros.recording.png import RowFilter, encode_png

P = TypeVar("P", CanBusPart, LidarsegPart, ScenePart)
VERSION = "v1.0-trainval"
"""Name of the folder of tables, unless another one is chosen."""
TEST_VERSION = "v1.0-test"
"""Name of the folder of tables that nuScenes' scenes of the split test have."""
_VERSION = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]*")
_OTHER_FOLDERS = ("samples", "sweeps", "maps", "lidarseg", "can_bus")


@dataclass(frozen=True, slots=True)
class ExportSettings:
    """Options of an export.

    Attributes:
        keyframe_hz: Number of keyframes, which have annotations, per second; None: every frame is one.
        sweeps: Whether to write sensor data between keyframes.
        lidarseg: Whether to write the categories of lidar points, for scenes with a semantic cloud.
        map_expansion: Whether to write the vector maps of nuScenes' map expansion.
        can_bus: Whether to write the messages of nuScenes' CAN bus expansion.
        scene_names: How scenes are named in the tables.
        version: Name of the tables' folder. With nuScenes' names, the scenes of the split test are in ``TEST_VERSION``.
        keep_unhit: Whether boxes without lidar and radar points are annotated, which nuScenes does not do.
        channels: Channels of cameras and radars that are not to have the names of ``channels_of``.
    """

    keyframe_hz: float | None = 2.0
    sweeps: bool = True
    lidarseg: bool = True
    map_expansion: bool = True
    can_bus: bool = True
    scene_names: SceneNames = SceneNames.OWN
    version: str = VERSION
    keep_unhit: bool = False
    channels: ChannelNames = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Raise InputError if the tables' folder has no name, or that of another folder."""
        if not _VERSION.fullmatch(self.version) or self.version in _OTHER_FOLDERS:
            raise InputError(
                f"{self.version!r} cannot be the name of the tables' folder: letters, digits, '.', '_' and '-' are "
                f"allowed, but not {', '.join(_OTHER_FOLDERS)}",
                parameter="version",
            )


_DEFAULTS = ExportSettings()


@dataclass(frozen=True, slots=True)
class Exported:
    """Result of an export.

    Attributes:
        scenes: Number of scenes in the export.
        made: Number of scenes that this run has exported; the others were already there.
        samples: Number of keyframes of all scenes.
        files: Number of sensor files of all scenes.
        failures: Reasons why scenes could not be exported, by name of the scene.
        origins_m: Origin of nuScenes' global frame in the frame ``map``, by name of the location.
        classes: Classes of nuScenes' detection task that occur as its evaluation counts them, by name of the split.
        unlabeled: Reasons why scenes have no labels of lidar points although labels were wanted, by name of the scene.
        has_roads: Whether masks and vector maps of the roads were written, which needs the simulator.
        without_imu: Number of scenes with CAN bus messages, but without an IMU.
    """

    scenes: int
    made: int
    samples: int
    files: int
    failures: Failures
    origins_m: dict[str, tuple[float, float]]
    classes: dict[str, tuple[str, ...]]
    unlabeled: dict[str, str]
    has_roads: bool
    without_imu: int


def export_nuscenes(
    dataset: Dataset,
    out: Path,
    settings: ExportSettings = _DEFAULTS,
    *,
    pool: Pool = OWN_PROCESS,
    report: Report = ignore_progress,
) -> Exported:
    """Export the finished scenes of a dataset; scenes that are already in the folder and have not changed are kept.

    Args:
        dataset: The dataset.
        out: Folder of the export, nuScenes' ``dataroot``.
        settings: What is written.
        pool: Workers that export scenes.
        report: Receives the progress.

    Raises:
        InputError: There is nothing to export, the folder cannot be written to or contains other data, another process
            writes into it, a map's roads cannot be built, there is no name for a scene, or names of channels are wrong.
        SimbevError: A process was killed.
    """
    if not dataset.scenes:
        raise InputError(f"{dataset.path}: it has no finished scene to export")
    names = published_names(dataset.scenes, settings.scene_names)
    if settings.channels:
        require_named_sensors(dataset.scenes[0], settings.channels)
    parts = parts_of(
        dataset,
        out,
        keyframe_hz=settings.keyframe_hz,
        sweeps=settings.sweeps,
        keep_unhit=settings.keep_unhit,
        channels=settings.channels,
    )
    if not is_begun(out) and any((out / name).exists() for name in (settings.version, "samples", "maps")):
        raise InputError(f"{out}: it holds data of nuScenes' layout that simbev has not written; take another folder")
    with hold_export(out):
        return _export(parts, out, settings, names, pool, report)


def _export(
    parts: Sequence[ScenePart],
    out: Path,
    settings: ExportSettings,
    names: Mapping[str, str],
    pool: Pool,
    report: Report,
) -> Exported:
    """Make the parts that are missing, then what is about all of them."""
    missing = unfinished(parts)
    failures = make_parts(make_part, missing, pool, report, sum(map(frame_count, missing)))
    made = len(missing) - len(failures)
    versions = _versions(parts, settings)
    labeled = {
        version: lidarseg_parts(without(group, failures), version) if settings.lidarseg else []
        for version, group in versions.items()
    }
    all_labeled = [part for group in labeled.values() for part in group]
    failures |= make_parts(make_lidarseg_part, unfinished(all_labeled), pool)
    finished = without(parts, failures)
    with foreign_content(out / PARTS_FOLDER):
        summaries = [{**part.summary(), "bag": str(part.scene.path)} for part in finished]
        sites = sites_of(summaries, has_roads=not load_extras()["sim"].missing)
    _write_maps(sites, out, with_expansion=settings.map_expansion)
    buses = can_bus_parts(finished, sites, names)
    failures |= _make_buses(buses, pool, wanted=settings.can_bus)
    classes: dict[str, tuple[str, ...]] = {}
    for version, group in versions.items():
        of_version = without(labeled[version], failures)
        with foreign_content(out / PARTS_FOLDER), write_errors(out):
            labels = [row for part in of_version for row in part.rows()]
            if there := without(group, failures):
                classes |= write_tables(out, there, sites, version, names, labels)
            remove_other_labels(out, version, of_version)
    for part in (*parts, *all_labeled, *buses):
        part.tidy_up()
    return Exported(
        scenes=len(finished),
        made=made,
        samples=sum(each["samples"] for each in summaries),
        files=sum(each["files"] for each in summaries),
        failures=failures,
        origins_m={site.name: site.low_m for site in sites},
        classes=classes,
        unlabeled={p.scene.name: why for p in finished if settings.lidarseg and (why := why_without_labels(p.scene))},
        has_roads=all(site.has_roads for site in sites),
        without_imu=sum(imu_of(part.scene) is None for part in buses) if settings.can_bus else 0,
    )


def _versions(parts: Sequence[ScenePart], settings: ExportSettings) -> dict[str, list[ScenePart]]:
    """The parts by folder of tables: as in nuScenes, scenes of the split test are apart if they have its names."""
    apart = settings.scene_names == SceneNames.NUSCENES
    versions: dict[str, list[ScenePart]] = {}
    for part in parts:
        version = TEST_VERSION if apart and part.scene.split == "test" else settings.version
        versions.setdefault(version, []).append(part)
    return versions


def _write_maps(sites: Sequence[Site], out: Path, *, with_expansion: bool) -> None:
    """Write the masks of sites, and their vector maps or none; without the simulator, masks without roads."""
    for site in sites:
        if site.has_roads:
            from simbev_exporters.nuscenes.map_expansion.expansion import expansion_part, write_expansion
            from simbev_exporters.nuscenes.map_masks import write_mask

            write_mask(site, out)
            write_expansion(site, out) if with_expansion else expansion_part(site, out).remove()
        else:
            write_whole(out / site.filename, encode_png(np.zeros(site.size_px[::-1], np.uint8), RowFilter.NONE))


def _make_buses(buses: Sequence[CanBusPart], pool: Pool, *, wanted: bool) -> Failures:
    """Make the messages of the CAN bus that are missing, or remove all."""
    if wanted:
        return make_parts(make_can_bus_part, unfinished(buses), pool)
    for bus in buses:
        bus.remove()
    return {}
