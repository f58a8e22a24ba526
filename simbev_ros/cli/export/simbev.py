"""``simbev export simbev``: writes a dataset in the layout of SimBEV."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from simbev_ros.cli.console import counting_bar, make_console, plural

if TYPE_CHECKING:
    from simbev_ros.export.simbev.export import FramesPart


def export_simbev(
    dataset: Annotated[Path, typer.Argument(help="A dataset's folder, or one scene's bag.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder in which the folder simbev is made.", show_default=False)],
    jobs: Annotated[int | None, typer.Option(help="Number of processes; default: number of cores.", min=1)] = None,
) -> None:
    """Write finished scenes in the layout of SimBEV: sweeps, ground truth, infos.

    After Ctrl-C or a crash the same command continues where it stopped; of a dataset that has grown only new scenes are
    written.

    [bold]Examples[/]

    simbev export simbev datasets/first --out exported
    """
    from simbev_ros.dataset import open_dataset
    from simbev_ros.dataset.lock import DatasetLock
    from simbev_ros.export.simbev.export import ROOT, finish, parts_of, remove_vanished

    opened, root, console = open_dataset(dataset, threads=1), out / ROOT, make_console()
    with DatasetLock(root):
        parts = parts_of(opened, root)
        remove_vanished(parts)
        made = _make(parts, jobs or os.cpu_count() or 1)
        missing = finish(opened, parts)
    frames = sum(part.count for part in parts)
    scenes = plural(len(opened.scenes), "scene")
    console.print(f"{frames} frames of {scenes} in {root}", highlight=False)
    if made < frames:
        console.print(f"{frames - made} of them were there already", highlight=False)
    for line in missing:
        console.print(line, style="dim", highlight=False)


def _make(parts: "list[FramesPart]", jobs: int) -> int:
    """Make the missing parts and return the number of their frames."""
    from simbev_ros.dataset.parallel import map_in_processes
    from simbev_ros.export.simbev.export import make_part

    todo = [part for part in parts if part.record() is None]
    frames = sum(part.count for part in todo)
    with counting_bar("frames", make_console(stderr=True), frames) as bar:
        for count in map_in_processes(make_part, todo, min(jobs, max(len(todo), 1))):
            bar.advance(count)
    return frames
