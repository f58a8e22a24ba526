"""What a dataset would take: how many scenes, how long, how large, from a measured sample."""

import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.filesize import decimal
from rich.table import Table

from simbev_ros.cli.dataset_maker import Drawer
from simbev_ros.cli.scenes import build_surroundings, scene_progress
from simbev_ros.config.scenario import SPLITS, Scenario
from simbev_ros.dataset.plan import Plan, PlannedEntry, bag_of
from simbev_ros.graph.session import GraphSession
from simbev_ros.recording.layout import bytes_of, scene_folder
from simbev_ros.recording.reader import SceneBag
from simbev_ros.scene.drawing.draw_scene import ticks_of

_SAMPLE_TICKS = 10


@dataclass(frozen=True, slots=True)
class Sample:
    """What a short scene took.

    Attributes:
        start_s: Until its first tick was finished, the processes being there.
        tick_s: Each tick after that.
        tick_bytes: In the bag, per tick.
        scene_bytes: In the bag, whatever the scene's length.
    """

    start_s: float
    tick_s: float
    tick_bytes: float
    scene_bytes: float


def show_estimate(scenario: Scenario, dataset: Path, entries: Sequence[PlannedEntry], console: Console) -> None:
    """Print which scenes would be made, and what they would take; nothing is written into the dataset."""
    there = [entry for entry in Plan.of(dataset).scenes if bag_of(dataset, entry).is_dir()]
    present = Counter((entry.map, entry.split) for entry in there)
    wanted = Counter((entry.map, entry.split) for entry in entries)
    table = Table("map", *(f"{split}: there" if first else f"{split}: to make" for split in SPLITS for first in (1, 0)))
    for name in dict.fromkeys(name for name, _ in (*present, *wanted)):
        counts = (str(count[name, split]) for split in SPLITS for count in (present, wanted))
        table.add_row(name, *counts)
    console.print(table)
    if not entries:
        console.print("nothing is missing")
        return
    sample = _sampled(scenario, entries[0], console)
    ticks = sum(ticks_of(scenario.time, scenario.seed + entry.number) for entry in entries)
    seconds = len(entries) * sample.start_s + ticks * sample.tick_s
    size = len(entries) * sample.scene_bytes + ticks * sample.tick_bytes
    free = shutil.disk_usage(_existing(dataset)).free
    console.print(
        f"{len(entries)} scenes, {ticks:,} frames: about {_hours(seconds)} and {decimal(round(size))} "
        f"({decimal(free)} are free); measured on {_SAMPLE_TICKS} frames of {entries[0].name}: "
        f"{sample.start_s:.1f} s to begin, {sample.tick_s:.2f} s and {decimal(round(sample.tick_bytes))} a frame",
        highlight=False,
        soft_wrap=True,
    )


def _sampled(scenario: Scenario, entry: PlannedEntry, console: Console) -> Sample:
    """The first of the scenes, cut short, in a temporary dataset."""
    spec = Drawer(scenario, console).draw(entry)
    spec = spec.model_copy(update={"ticks": min(_SAMPLE_TICKS, spec.ticks)})
    build_surroundings([spec], console)
    finished_s: list[float] = []
    with tempfile.TemporaryDirectory(prefix="simbev_ros-sample-") as folder:
        with GraphSession(scenario, dataset=Path(folder)) as session, scene_progress(spec, console) as bar:
            first = spec.model_copy(update={"ticks": 1, "number": spec.number + 1})
            session.play(first, lambda _: None)  # starting processes is paid once for all scenes
            began_s = time.monotonic()

            def progress(tick: int | None) -> None:
                bar(tick)
                while tick is not None and len(finished_s) <= tick:
                    finished_s.append(time.monotonic() - began_s)

            session.play(spec, progress)
        bag_path = scene_folder(Path(folder), spec.split, spec.name)
        size = bytes_of(bag_path)
        with SceneBag(bag_path) as bag:
            fixed = min(sum(len(data) for data in bag.attachments.values()), size)
    ticks = len(finished_s)
    tick_s = (finished_s[-1] - finished_s[0]) / max(ticks - 1, 1)
    return Sample(finished_s[0], tick_s, (size - fixed) / ticks, fixed)


def _existing(path: Path) -> Path:
    """The folder itself, or the nearest one above it that is there."""
    return next(folder for folder in (path.resolve(), *path.resolve().parents) if folder.exists())


def _hours(seconds: float) -> str:
    minutes = round(seconds / 60.0)
    return f"{seconds:.0f} s" if minutes < 2 else f"{minutes} min" if minutes < 120 else f"{minutes / 60:.1f} h"
