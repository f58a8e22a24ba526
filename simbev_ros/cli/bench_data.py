"""What of ``simbev bench`` times work on data: reading and recording bags, evaluating predictions."""

import os
import tempfile
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from simbev_ros.cli.bench_report import Json, progress_bar, show_timing


def reading(
    path: Annotated[Path, typer.Argument(help="A dataset, of which the first scene is read, or a bag.")],
    frames: Annotated[
        int, typer.Option(help="Frames to read in each order; the median counts.", min=1, max=10_000)
    ] = 20,
    as_json: Json = False,
) -> None:
    """Time how fast frames of a recorded scene are read and decoded with all that they have.

    In order, where what lies together is decompressed once, and at random, each with nothing read before but the index.

    [bold]Example[/]

    simbev bench reading datasets/first --frames 50
    """
    from simbev_ros.bench.reading_timing import timed_reading

    with progress_bar("frames", Console(stderr=True)) as bars:
        task = bars.add_task("", total=2 * frames)
        result = timed_reading(path, frames, lambda: bars.advance(task))
    show_timing(
        result,
        f"reading {result.scene}, {result.decoded_mb:.0f} MB of arrays a frame",
        ("", "s/frame", "least", "CPU s/frame", "frames/s"),
        result.rows(),
        as_json=as_json,
    )


def record(
    folder: Annotated[Path | None, typer.Option(help="On the disk to write to; by default the temporary one.")] = None,
    ticks: Annotated[int, typer.Option(help="In each file.", min=1, max=1000)] = 20,
    rounds: Annotated[int, typer.Option(help="How often each file is written.", min=1, max=100)] = 5,
    as_json: Json = False,
) -> None:
    """Time the recorder on six 1600x900 cameras: raw colour images, and all modalities compressed with a lidar.

    The writer alone, and the recorder's node, which gets them through DDS from a process that shares the cores with it.
    For comparison, the same messages are written in a bare loop of the mcap package's own writer, with its own settings
    and chunks as large as ours.

    [bold]Example[/]

    simbev bench record --folder /data --ticks 100 --json
    """
    from simbev_ros.bench.record_timing import files_to_write, timed_recording

    console = Console(stderr=True)
    with progress_bar("files", console) as bars:
        task = bars.add_task("", total=files_to_write(rounds))
        place = folder or Path(tempfile.gettempdir())
        result = timed_recording(place, ticks, rounds, console, lambda: bars.advance(task))
    show_timing(
        result,
        "recording",
        ("topics", "by", "MB/s", "best", "CPU s/GB", "size", "× mcap"),
        result.rows(),
        as_json=as_json,
    )


def evaluate(
    scenes: Annotated[int, typer.Option(help="Of 320 frames with 81 boxes each; the paper has 320.", min=1)] = 320,
    jobs: Annotated[int | None, typer.Option(help="Scenes at once; as many as there are cores.", min=1)] = None,
    as_json: Json = False,
) -> None:
    """Time the detection metrics on synthetic boxes with noisy predictions: matching by IoU, by distance, the table.

    For comparison, the nuscenes-devkit evaluates some of the frames too, if it can be imported, or if the tests have
    made its environment.

    [bold]Example[/]

    simbev bench evaluate --scenes 20 --json
    """
    from simbev_ros.bench.evaluate_timing import timed_evaluation

    with progress_bar("scenes", Console(stderr=True)) as bars:
        task = bars.add_task("", total=scenes)
        result = timed_evaluation(scenes, jobs or os.cpu_count() or 1, lambda: bars.advance(task))
    show_timing(
        result, result.title(), ("", "s", "CPU s"), result.rows(), as_json=as_json, comparison=result.comparison()
    )
