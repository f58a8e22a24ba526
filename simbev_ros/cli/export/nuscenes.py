"""``simbev export nuscenes``: a dataset in nuScenes' layout."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from simbev_ros.errors import SimbevError


def export_nuscenes(
    dataset: Annotated[Path, typer.Argument(help="A dataset's folder, or one scene's bag.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder to export to, nuScenes' dataroot.", show_default=False)],
    keyframe_hz: Annotated[
        float, typer.Option(help="Samples, which have annotations, per second.", min=0.01, max=1000)
    ] = 2.0,
    all_frames: Annotated[bool, typer.Option("--all-frames", help="Every frame is a sample.")] = False,
    sweeps: Annotated[bool, typer.Option(help="Write what sensors saw between samples.")] = True,
    version: Annotated[str, typer.Option(help="Name of the folder of tables.")] = "v1.0-trainval",
    jobs: Annotated[int | None, typer.Option(help="Scenes at once; as many as there are cores.", min=1)] = None,
) -> None:
    """Write finished scenes as nuScenes does, for the nuscenes-devkit: tables, samples, sweeps, masks of maps.

    A sample has of each sensor what it saw at that very time, or else its last before: boxes lie on what images show if
    the rates of all sensors are multiples of --keyframe-hz.

    After Ctrl-C or a crash the same command goes on where it was; of a dataset that has grown only what is new is made.
    The devkit's splits are lists of nuScenes' scenes. Ours are in splits.json beside the tables, as simbev_train,
    simbev_val and simbev_test; the devkit finds them there from its release 1.2 on.

    [bold]Examples[/]

    simbev export nuscenes datasets/first --out exported

    simbev export nuscenes datasets/first --out exported --keyframe-hz 4 --no-sweeps
    """
    from simbev_ros.dataset import open_dataset
    from simbev_ros.export.nuscenes.export import export_nuscenes

    opened = open_dataset(dataset, threads=1)
    rate_hz = None if all_frames else keyframe_hz
    with _bar() as report:
        done = export_nuscenes(
            opened,
            out,
            keyframe_hz=rate_hz,
            sweeps=sweeps,
            version=version,
            jobs=jobs or os.cpu_count() or 1,
            report=report,
        )
    console = Console(soft_wrap=True, highlight=False)
    there = done.scenes - done.made
    console.print(f"{done.samples} samples of {_scenes(done.scenes)}, {done.files} files in {escape(str(out))}")
    if there:
        console.print(f"{_scenes(there)} {'was' if there == 1 else 'were'} there already")
    for reason in done.failures.values():
        console.print(f"[red]{escape(reason)}[/]")
    if done.failures:
        raise SimbevError(f"{len(done.failures)} of {_scenes(len(opened.scenes))} could not be exported")


def _scenes(count: int) -> str:
    return f"{count} scene{'s' * (count != 1)}"


@contextmanager
def _bar() -> Iterator[Callable[[int, int], None]]:
    """A bar of frames, and what to tell it: how many are done, and how many there are."""
    columns = (TextColumn("frames"), BarColumn(bar_width=None), MofNCompleteColumn())
    with Progress(
        *columns, TimeElapsedColumn(), TimeRemainingColumn(), console=Console(stderr=True), expand=True, transient=True
    ) as bar:
        task = bar.add_task("", total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
