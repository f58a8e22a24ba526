"""Exports a dataset to a layout of labeled images: scenes in parallel, then the files about all of them.

An opened dataset and a ``Layout`` enter; a folder in the layout leaves. A part of the work is one scene.
"""

from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from simbev_exporters.labeled_images.layout import ImagePart, Layout, make_part
from simbev_exporters.recorded_sensors import recorded_cameras
from simbev_exporters.scene_parts import Failures, Report, ignore_progress, make_missing, source_of, without
from simbev_ros.config.scenario import SPLITS
from simbev_ros.dataset import Dataset, Scene
from simbev_ros.dataset.parallel import OWN_PROCESS, Pool
from simbev_ros.export.parts import PARTS_FOLDER, hold_export, is_begun, remove_vanished
from simbev_ros.foundation.errors import BagError, InputError, foreign_content
from simbev_ros.foundation.files.whole_files import write_errors


@dataclass(frozen=True, slots=True)
class Exported:
    """Result of an export.

    Attributes:
        scenes: Number of scenes in the export.
        made: Number of scenes that this run has exported; the others were already there.
        images: Number of images by split, of all splits that have a scene.
        objects: Number of labeled objects in all images.
        left_out: Recorded cameras that are left out although none were chosen.
        failures: Reasons why scenes could not be exported, by name of the scene.
    """

    scenes: int
    made: int
    images: dict[str, int]
    objects: int
    left_out: tuple[str, ...]
    failures: Failures


def export_images(
    dataset: Dataset, out: Path, layout: Layout, *, pool: Pool = OWN_PROCESS, report: Report = ignore_progress
) -> Exported:
    """Export the finished scenes of a dataset; those that are already in the folder and have not changed are kept.

    Args:
        dataset: The dataset.
        out: Folder of the export. What it has of the layout from other scenes is removed.
        layout: The layout.
        pool: Workers that export scenes.
        report: Called from time to time with the number of finished images and the number of all images to export.

    Raises:
        InputError: There is nothing to export, the folder cannot be written to or contains other data, another process
            writes into it, the rate does not divide that of the frames, or no scene has one of the cameras.
        SimbevError: A process was killed.
    """
    if not dataset.scenes:
        raise InputError(f"{dataset.path}: it has no finished scene to export")
    if not is_begun(out) and any((out / name).exists() for name in layout.folders):
        raise InputError(f"{out}: it holds {' or '.join(layout.folders)} that simbev has not written; take another one")
    parts, recorded, failures = [], set[str](), Failures()
    counts: dict[str, int] = {}
    for scene in dataset.scenes:
        try:
            recorded |= {*recorded_cameras(scene)}
            counts[scene.name] = len(layout.images_of(scene))
            parts.append(_part(scene, out, layout))
        except BagError as error:
            failures[scene.name] = str(error)
    _require_different(dataset, parts)
    _require_cameras(layout, recorded)
    with hold_export(out):
        _remove_vanished(out, layout, parts)
        missing, failed = make_missing(make_part, parts, pool, report, lambda part: counts[part.scene.name])
        failures |= failed
        finished = without(parts, failures)
        with foreign_content(out / PARTS_FOLDER), write_errors(out):
            layout.finish(out, finished)
    records = [part.finished_record() for part in finished]
    used = {name for part in finished for name in layout.cameras_of(part.scene)}
    splits = {split: [r for p, r in zip(finished, records, strict=True) if p.scene.split == split] for split in SPLITS}
    with foreign_content(out / PARTS_FOLDER):
        return Exported(
            scenes=len(finished),
            made=sum(part in missing for part in finished),
            images={split: sum(r["images"] for r in of_split) for split, of_split in splits.items() if of_split},
            objects=sum(record["objects"] for record in records),
            left_out=tuple(sorted(recorded - used)) if layout.cameras is None else (),
            failures=failures,
        )


def _part(scene: Scene, out: Path, layout: Layout) -> ImagePart:
    settings = {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(layout).items()}
    stem = layout.stem(scene)
    return ImagePart(
        out=out,
        name=f"{stem}.{layout.name}",
        identity={"made_from": {**source_of(scene), "split": scene.split, **settings}},
        patterns=layout.patterns(stem),
        scene=scene,
        layout=layout,
    )


def _require_different(dataset: Dataset, parts: Sequence[ImagePart]) -> None:
    """Refuse scenes whose files would have the same names."""
    scene_of: dict[str, str] = {}
    for part in parts:
        if part.name in scene_of:
            pair = f"{scene_of[part.name]} and {part.scene.name}"
            raise InputError(f"{dataset.path}: {pair} have the same number, from which names of files follow")
        scene_of[part.name] = part.scene.name


def _require_cameras(layout: Layout, recorded: Collection[str]) -> None:
    unknown = sorted({*(layout.cameras or ())} - {*recorded})
    if unknown and recorded:
        known = ", ".join(sorted(recorded))
        raise InputError(f"no scene has images of {', '.join(unknown)}, but of {known}", parameter=layout.camera_option)


def _remove_vanished(out: Path, layout: Layout, parts: Sequence[ImagePart]) -> None:
    """Remove the layout's files of other scenes, as readers take all images in a folder."""
    suffix = f".{layout.name}"

    def patterns_of(name: str) -> tuple[str, ...] | None:
        return layout.patterns(name.removesuffix(suffix)) if name.endswith(suffix) else None

    remove_vanished(out, [part.name for part in parts], patterns_of)
