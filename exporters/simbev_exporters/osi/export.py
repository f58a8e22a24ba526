"""Exports the ground truth of a dataset as trace files of ASAM OSI: one file for each scene, in parallel.

The entry point of ``simbev export osi``: an opened dataset enters; MCAP files with ``osi3.GroundTruth`` leave.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING

from simbev_exporters.scene_parts import (
    Failures,
    PartOfScene,
    Report,
    frame_count,
    ignore_progress,
    make_missing,
    source_of,
    without,
)
from simbev_ros.dataset import Dataset
from simbev_ros.dataset.parallel import OWN_PROCESS, Pool, report_step
from simbev_ros.export.parts import PARTS_FOLDER, hold_export
from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_ros.foundation.installation.extras import load_extras
from simbev_ros.foundation.object_store.object_path import require_local
from simbev_ros.foundation.units import NS_PER_S

if TYPE_CHECKING:
    from osi3.osi_groundtruth_pb2 import GroundTruth


@dataclass(frozen=True, slots=True, kw_only=True)
class OsiPart(PartOfScene):
    """The trace of a scene as one part of the export. Its record has the number of ``messages``.

    Attributes:
        has_lanes: Whether lanes are written, which needs the simulator.
    """

    has_lanes: bool


@dataclass(frozen=True, slots=True)
class Exported:
    """Result of an export.

    Attributes:
        scenes: Number of scenes in the export.
        made: Number of scenes that this run has exported; the others were already there.
        messages: Number of messages of all scenes.
        failures: Reasons why scenes could not be exported, by name of the scene.
        has_lanes: Whether lanes were written.
    """

    scenes: int
    made: int
    messages: int
    failures: Failures
    has_lanes: bool


def export_osi(dataset: Dataset, out: Path, *, pool: Pool = OWN_PROCESS, report: Report = ignore_progress) -> Exported:
    """Export the finished scenes of a dataset; scenes that are already in the folder and have not changed are kept.

    Args:
        dataset: The dataset.
        out: Folder of the trace files.
        pool: Workers that export scenes.
        report: Receives the progress.

    Raises:
        InputError: There is nothing to export, the folder cannot be written to, another process writes into it, or a
            map's roads cannot be built.
        SimbevError: A process was killed.
    """
    if not dataset.scenes:
        raise InputError(f"{dataset.path}: it has no finished scene to export")
    has_lanes = not load_extras()["sim"].missing
    parts = [
        OsiPart(
            out=out,
            name=f"{scene.name}.osi",
            identity={"made_from": {**source_of(scene), "lanes": has_lanes}},
            patterns=(f"*_gt_*_{escape(scene.name)}.mcap",),
            scene=scene,
            has_lanes=has_lanes,
        )
        for scene in dataset.scenes
    ]
    with hold_export(out):
        missing, failures = make_missing(make_part, parts, pool, report, frame_count)
        finished = without(parts, failures)
        with foreign_content(out / PARTS_FOLDER):
            messages = sum(part.finished_record()["messages"] for part in finished)
    return Exported(len(finished), len(missing) - len(failures), messages, failures, has_lanes)


def make_part(part: OsiPart) -> None:
    """Make the trace of one scene, in any process; each message is a step of parallel work.

    Raises:
        InputError: The scene's roads cannot be built, or a file cannot be written.
        BagError: The bag is damaged or lacks data.
    """
    from simbev_exporters.osi.ground_truth import ground_truths, true_ticks
    from simbev_exporters.osi.trace import trace_name, write_trace

    scene, roads = part.scene, None
    ticks = true_ticks(scene)
    part.begin()
    if part.has_lanes:
        from simbev_exporters.osi.lanes import map_messages
        from simbev_exporters.recorded_roads import recorded_roads

        roads = map_messages(recorded_roads(require_local(scene.path)))

    def counted() -> Iterator["GroundTruth"]:
        for message in ground_truths(scene, ticks, roads):
            yield message
            report_step()

    start = datetime.fromtimestamp(int(scene.stamps_ns[0]) // NS_PER_S, UTC)
    with part.open(trace_name(f"{start:%Y%m%dT%H%M%SZ}", len(ticks), scene.name)) as file:
        write_trace(file, counted(), f"{scene.name}: {scene.map}, {scene.split}")
    part.finish({"messages": len(ticks)})
