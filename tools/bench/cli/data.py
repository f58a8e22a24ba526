"""``simbev bench`` commands that time work on data: reading, recording, evaluation, and maps."""

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from simbev_ros.cli.console import counting_bar, make_console
from simbev_ros.cli.pool import Workers, processes
from simbev_ros.cli.timing_report import Json, show_timing
from simbev_ros.foundation.files.whole_files import require_writable
from tools.bench.cli.number_list import numbers_in

_MAX_SIDES = 30


def reading(
    path: Annotated[Path, typer.Argument(help="A bag, or a dataset; its first scene is read.")],
    frames: Annotated[
        int, typer.Option(help="Number of frames to read in each order, of which medians are taken.", min=1, max=10_000)
    ] = 20,
    as_json: Json = False,
) -> None:
    """Time how fast whole frames of a recorded scene are read and decoded.

    They are read in order, so that neighbors are decompressed together, and at random, each with nothing but the index
    in memory.

    [bold]Example[/]

    python -m tools.bench reading datasets/first --frames 50
    """
    from tools.bench.reading_timing import timed_reading

    with counting_bar("frames", make_console(stderr=True), 2 * frames) as bar:
        result = timed_reading(path, frames, bar.advance)
    show_timing(
        result,
        f"reading {result.scene}, {result.decoded_mb:.0f} MB of arrays a frame",
        ("", "s/frame", "least", "CPU s/frame", "frames/s"),
        result.rows(),
        as_json=as_json,
    )


def record(
    folder: Annotated[
        Path | None, typer.Option(help="A folder on the disk to write to; default: that of temporary files.")
    ] = None,
    ticks: Annotated[int, typer.Option(help="Number of ticks in each file.", min=1, max=1000)] = 20,
    rounds: Annotated[int, typer.Option(help="Number of times each file is written.", min=1, max=100)] = 5,
    as_json: Json = False,
) -> None:
    """Time the recorder on six 1600x900 cameras: raw color images, and all modalities compressed with a lidar.

    The writer is timed alone, and in the recorder node, which receives messages through DDS from a process that shares
    the cores with it. For comparison, a bare loop writes the same messages with the mcap package's writer, with its own
    settings and our chunk size.

    [bold]Example[/]

    python -m tools.bench record --folder /data --ticks 100 --json
    """
    from simbev_ros.cli.production_display import SceneDisplay
    from tools.bench.record_timing import files_to_write, timed_recording

    console = make_console(stderr=True)
    target = folder or Path(tempfile.gettempdir())
    require_writable(target)
    with counting_bar("files", console, files_to_write(rounds)) as bar:
        result = timed_recording(target, ticks, rounds, bar.advance, SceneDisplay(console))
    show_timing(
        result,
        "recording",
        ("topics", "by", "MB/s", "best", "CPU s/GB", "size", "× mcap"),
        result.rows(),
        as_json=as_json,
    )


def evaluate(
    scenes: Annotated[
        int, typer.Option(help="Number of scenes of 320 frames with 81 boxes each; the paper has 320.", min=1)
    ] = 320,
    workers: Workers = None,
    as_json: Json = False,
) -> None:
    """Time the detection metrics on synthetic boxes with noisy predictions: matching by IoU and by distance, averages.

    For comparison, the nuscenes-devkit evaluates some of the frames too, if it can be imported or the tests have made
    its environment.

    [bold]Example[/]

    python -m tools.bench evaluate --scenes 20 --json
    """
    from tools.bench.evaluate_timing import timed_evaluation

    pool = processes(workers)
    with counting_bar("scenes", make_console(stderr=True), scenes) as bar:
        result = timed_evaluation(scenes, pool.workers, bar.advance)
    show_timing(
        result, result.title(), ("", "s", "CPU s"), result.rows(), as_json=as_json, comparison=result.comparison()
    )


def city(
    path: Annotated[Path, typer.Argument(help="An OpenStreetMap file of a part of a city.")],
    sides: Annotated[
        str, typer.Option(help="How often the city is repeated to the east and to the north, separated by commas.")
    ] = "1,2,4,8",
    as_json: Json = False,
) -> None:
    """Time how the building of a city grows with its area: the file is repeated side by side.

    Each area is built in a process of its own without a cache: its roads, and its surroundings within 400 m of its
    busiest place.

    [bold]Example[/]

    python -m tools.bench city helsinki.osm.pbf --sides 1,2
    """
    from tools.bench.city_timing import timed_city

    numbers = numbers_in(sides, "--sides", _MAX_SIDES)
    with counting_bar("areas", make_console(stderr=True), len(numbers)) as bar:
        result = timed_city(path, numbers, bar.advance)
    show_timing(
        result,
        result.city,
        ("km²", "km of lanes", "roads, CPU s", "CPU s/km²", "surroundings, CPU s/km²", "MiB", "netconvert's MiB"),
        result.rows(),
        as_json=as_json,
    )
