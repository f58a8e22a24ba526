"""``python -m tools.bench production``: times the driver of datasets with many scenes."""

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from simbev_ros.cli.console import counting_bar, make_console
from simbev_ros.cli.timing_report import Json, show_timing
from simbev_ros.foundation.files.limits import MAX_SCENE_NUMBER
from simbev_ros.foundation.files.whole_files import require_writable
from tools.bench.cli.number_list import numbers_in


def production(
    dataset: Annotated[Path, typer.Argument(help="A dataset; its first scene is copied.", metavar="DATASET")],
    scenes: Annotated[str, typer.Option(help="Numbers of scenes to make, separated by commas.")] = "320,10000",
    ray: Annotated[
        str | None,
        typer.Option(help="Copy with actors on this Ray cluster, as for generate.", metavar="auto|HOST:PORT"),
    ] = None,
    workers: Annotated[int, typer.Option(help="Number of workers without Ray.", min=1, max=1000)] = 4,
    folder: Annotated[
        Path | None,
        typer.Option(
            help="A folder on the disk to write to, which the nodes of a cluster see; default: that of temporary files."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Time the driver of generate alone, and measure its memory: its workers only copy a recorded scene.

    Each number of scenes is made in a process of its own, as a dataset that is removed afterwards. Without Ray the
    driver's process copies. The time per scene is that of the second half of the scenes, without copying there. The
    last time is that of reading the finished dataset again, with which every further run begins.

    [bold]Example[/]

    python -m tools.bench production datasets/first --scenes 100,1000 --json
    """
    from tools.bench.production.copying_workers import RecordedScene
    from tools.bench.production.driver_timing import require_space, timed_production

    counts = numbers_in(scenes, "--scenes", MAX_SCENE_NUMBER + 1, smallest=2)
    target = folder or Path(tempfile.gettempdir())
    require_writable(target)
    recorded = RecordedScene.first_of(dataset)
    require_space(target, recorded, max(counts))
    with counting_bar("datasets", make_console(stderr=True), len(counts)) as bar:
        result = timed_production(recorded, counts, folder=target, workers=workers, ray=ray, advance=bar.advance)
    show_timing(
        result,
        result.title(),
        ("scenes", "s", "late ms/scene", "copying, s", "index, s", "written", "read again, s", "peak MiB"),
        result.rows(),
        as_json=as_json,
    )
